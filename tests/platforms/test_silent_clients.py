"""A client with a lease (``lobby.lease``) that sends nothing any more, as one that is held by SIGSTOP."""

from __future__ import annotations

import pytest
from segway_lab import Lab
from so101_lab import Lab as Arm

from urbihw.kernel.lobby.lobby import Lobby


class Drive:
    """A Segway that a client with a lease of 2 s drives, at 1 m/s in the end."""

    def __init__(self) -> None:
        self.lab = Lab.ready()
        self.client = self.lab.kernel.open_lobby()
        self.say(b"lobby.lease = 2s; rmp.forwardSpeed = 1;")

    def say(self, data: bytes, lobby: Lobby | None = None) -> bytes:
        """Send something; what comes back at once."""
        lobby = lobby or self.client
        self.lab.kernel.feed(lobby, data)
        self.lab.run(0)
        return lobby.output.take_bytes()

    def speed_after(self, seconds: float) -> float:
        """The speed of the body some time later."""
        self.lab.run(seconds)
        return round(self.lab.base.body.speed, 2)


@pytest.fixture
def drive() -> Drive:
    return Drive()


def test_it_drives_on_while_the_client_sends_empty_lines(drive: Drive) -> None:
    for _ in range(5):
        drive.say(b"\n")
        assert drive.speed_after(1.9) == 1.0
    assert drive.client.output.take_bytes() == b""


def test_it_stands_when_the_client_is_silent_and_drives_when_it_speaks_again(
    drive: Drive, caplog: pytest.LogCaptureFixture
) -> None:
    assert drive.speed_after(1.9) == 1.0
    assert drive.speed_after(2.0) == 0.0
    assert "has sent nothing for 2 s (lobby.lease)" in caplog.text
    assert drive.speed_after(5.0) == 0.0
    drive.say(b"rmp.forwardSpeed = 1;")
    assert drive.speed_after(1.9) == 1.0
    assert drive.speed_after(2.0) == 0.0, "the second time, too"


@pytest.mark.parametrize(
    "program",
    [
        b"every (100ms) { rmp.forwardSpeed = 1 },",
        b"every (100ms) { try { rmp.forwardSpeed = 1 } catch {} },",
        b"var n = 0|; every (100ms) n += 1, at (n % 2 == 0) rmp.forwardSpeed = 1;",
        b"var l = Lobby.create|; l.receive(\"every (100ms) { rmp.forwardSpeed = 1 },\");",
        b"every (100ms) { rmp.forwardSpeed = 1; lobby.receive(\"\\n\"); },",
        b"every (300ms) { try { lobby.lease = 2s } catch {}; try { rmp.forwardSpeed = 1 } catch {} },",
    ],
    ids=["loop", "loop that catches", "handler", "made lobby", "loop that speaks for the client", "loop that renews"],
)
def test_no_program_of_a_silent_client_moves_it(drive: Drive, program: bytes) -> None:
    drive.say(program)
    assert drive.speed_after(1.9) == 1.0
    assert drive.speed_after(2.0) == 0.0
    assert drive.speed_after(3.0) == 0.0


@pytest.mark.parametrize(
    "program",
    [
        b"every| (300ms) { try { lobby.lease = 1h } catch {} },",
        b"every| (300ms) { try { lobby.lease = 0 | lobby.lease = 2s | rmp.forwardSpeed = 1 } catch {} },",
        b"sleep(1s); lobby.lease = 2s; sleep(1s); lobby.lease = 0; rmp.forwardSpeed = 1;",
        b"sleep(1s) | segway.estop = true | segway.estop = false | rmp.forwardSpeed = 1 | lobby.lease = 1h,",
    ],
    ids=["lengthens", "ends and begins", "text that waits", "a release of its own"],
)
def test_no_program_sent_with_a_lease_changes_it(drive: Drive, program: bytes) -> None:
    drive.say(b"lobby.lease = 2s; rmp.forwardSpeed = 1;" + program)
    assert drive.speed_after(2.5) < 0.5
    assert drive.speed_after(2.0) == 0.0
    assert drive.speed_after(2.0) == 0.0


def test_what_a_program_of_a_silent_client_has_connected_does_not_move_it(drive: Drive) -> None:
    """A Socket to the server itself, which has a lease of its own and keeps it."""
    other = drive.lab.kernel.open_lobby()
    other.set_maker(drive.client)
    drive.say(b"lobby.lease = 1s; rmp.forwardSpeed = 1;", other)
    for _ in range(10):
        drive.say(b"try { rmp.forwardSpeed = 1 } catch {};", other)
        speed = drive.speed_after(0.5)
    assert speed == 0.0
    third = drive.lab.kernel.open_lobby()
    third.set_maker(drive.client)
    assert b"has sent nothing for 2 s (lobby.lease)" in drive.say(b"rmp.forwardSpeed = 1;", third)
    drive.say(b"\n")
    drive.say(b"rmp.forwardSpeed = 1;", third)
    assert drive.speed_after(1.9) == 1.0


def test_what_waited_unread_before_its_turn_is_no_sign_of_life(drive: Drive) -> None:
    """A client that has sent too much in advance may be held since then."""
    drive.say(b"sleep(3s);" + b"1|2|3;\n" * 2000)
    drive.client.unread.pause()
    drive.client.unread.resume()
    assert drive.speed_after(1.9) == 1.0
    drive.say(b"4;")
    assert drive.speed_after(1.0) == 0.0


def test_a_lease_is_changed_by_what_is_sent_after_it_has_begun(drive: Drive) -> None:
    told = drive.say(b"lobby.lease = 3s; lobby.lease = 4s;")
    assert b" 3\n" in told and b"a lease is changed and ended by what the client sends after it has begun" in told
    assert b" 5\n" in drive.say(b"lobby.lease = 5s;")
    assert drive.speed_after(4.9) == 1.0
    assert drive.speed_after(2.0) == 0.0


def test_a_lease_is_ended_by_zero_and_belongs_to_its_own_connection(drive: Drive) -> None:
    other = drive.lab.kernel.open_lobby()
    drive.say(b"var Global.driver = lobby|;")
    other.output.take_bytes()
    assert b"belongs to another connection" in drive.say(b"Global.driver.lease = 0;", other)
    assert b"[00" in drive.say(b"lobby.lease;") and b" 2\n" in drive.say(b"lobby.lease;")
    assert b"a lease lasts for 0.1 to 3600 s, or 0 s for none" in drive.say(b"lobby.lease = 10ms;")
    drive.say(b"lobby.lease = 0;")
    assert drive.speed_after(10.0) == 1.0


@pytest.mark.parametrize(
    "order", [b"shoulder_pan.val = 1 time:4s,", b'lobby.answerWrites("c", ["shoulder_pan.val"], [1]),']
)
def test_an_arm_holds_where_it_is_when_a_lease_of_half_a_second_is_over(order: bytes) -> None:
    lab = Arm.ready()
    lab.say("motors.load = 1; shoulder_pan.speed = 0.25;", 0.1)
    client = lab.kernel.open_lobby()
    lab.kernel.feed(client, b"lobby.lease = 0.5;" + order)
    lab.run(0.5)
    going = lab.bend("shoulder_pan")
    assert 0.05 < going < 0.2
    lab.run(0.15)
    held = lab.bend("shoulder_pan")
    lab.run(3.0)
    assert lab.bend("shoulder_pan") == pytest.approx(held, abs=0.01)
    assert held < going + 0.1
