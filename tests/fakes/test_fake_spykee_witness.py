"""The simulated Spykee against a client that was typed from the fact sheet alone (``spykee_witness``)."""

from __future__ import annotations

import math

import pytest
from spykee_witness import SpykeeClient

from urbihw_fakes.endpoint import MemoryEndpoint, SteppedClock
from urbihw_fakes.spykee.device import Spykee

ACCEPTED = bytes.fromhex(
    "50 4b 0b 00 22 01 10 53 50 59 4b 45 45 30 30 31 31 32 32 33 33 34 34 06 53 70 79 6b 65 65 00"
    "06 31 2e 30 2e 33 34 01"
)


class Stage:
    """A robot, a connection to it, and the client."""

    def __init__(self, robot: Spykee | None = None) -> None:
        self.robot = Spykee() if robot is None else robot
        self.closed = 0
        self.robot.on_close = self._close
        self.clock = SteppedClock()
        self.wire = MemoryEndpoint(self.robot, self.clock)
        self.client = SpykeeClient(self.wire)

    def _close(self) -> None:
        self.closed += 1

    def run(self, seconds: float) -> None:
        """Let time pass, and take what comes."""
        end = self.clock.now() + seconds
        while self.clock.now() < end:
            if self.client.take(min(0.1, end - self.clock.now())) is None:
                self.robot.body.advance(self.clock.now())


@pytest.fixture
def stage() -> Stage:
    made = Stage()
    assert made.client.login("admin", "admin")
    return made


def test_the_login_is_that_of_the_sheet() -> None:
    stage = Stage()
    stage.wire.write(bytes.fromhex("50 4b 0a 00 0c 05 61 64 6d 69 6e 05 61 64 6d 69 6e"))
    data = b""
    while more := stage.wire.read(100, 0.3):
        data += more
    assert data == ACCEPTED + bytes.fromhex("50 4b 03 00 01 57")
    assert stage.robot.discovered() == b"DSCV\x02\x29uid=SPYKEE0011223344,connected-user=admin"


def test_discovery_is_that_of_the_sheet() -> None:
    answer = "44 53 43 56 02 14 75 69 64 3d 53 50 59 4b 45 45 30 30 31 31 32 32 33 33 34 34"
    assert Spykee().discovered() == bytes.fromhex(answer)


def test_a_wrong_password_is_refused_and_the_line_closed() -> None:
    stage = Stage()
    assert not stage.client.login("admin", "nimda")
    assert len(stage.client.replies[-1]) < 8
    stage.client.listen(0.2)
    assert stage.closed == 1


def test_a_move_before_the_first_power_packet_ends_the_connection() -> None:
    stage = Stage()
    stage.client.send(10, 5, b"admin", 5, b"admin")
    assert stage.client.take(2.0) == 11
    stage.client.send(5, 60, 60)
    assert stage.closed == 1
    assert stage.robot.body.wanted == [0.0, 0.0]


def test_it_drives_as_the_vectors_say_and_does_not_stop_by_itself(stage: Stage) -> None:
    body = stage.robot.body
    stage.wire.write(bytes.fromhex("50 4b 05 00 02 ce 32"))
    stage.run(2.0)
    assert (body.speeds[0] < -0.2, body.speeds[1] > 0.2, body.heading > 0.5) == (True, True, True)
    stage.robot.disconnect()
    body.advance(stage.clock.now() + 5)
    assert body.speeds[1] > 0.2


def test_tracks_have_inertia(stage: Stage) -> None:
    body = stage.robot.body
    stage.client.send(5, 100, 100)
    stage.run(0.1)
    assert 0.05 < body.speeds[0] < 0.2
    stage.run(1.0)
    assert body.speeds[0] == pytest.approx(0.42)
    stage.client.send(5, 0, 0)
    stage.run(0.1)
    assert 0.2 < body.speeds[0] < 0.4


def test_lights_sounds_and_volume(stage: Stage) -> None:
    for vector in ("50 4b 04 00 02 00 01", "50 4b 07 00 01 02", "50 4b 09 00 01 32"):
        stage.wire.write(bytes.fromhex(vector))
    assert (stage.robot.leds[0], stage.robot.sounds, stage.robot.volume) == (1, [2], 50)


def test_pictures_come_only_while_they_are_switched_on(stage: Stage) -> None:
    pytest.importorskip("PIL")
    stage.run(1.0)
    assert stage.client.pictures == []
    stage.client.send(15, 1, 1)
    stage.run(2.0)
    assert 30 <= len(stage.client.pictures) <= 40
    stage.client.send(15, 1, 0)
    stage.client.listen(0.5)
    count = len(stage.client.pictures)
    stage.run(1.0)
    assert len(stage.client.pictures) == count


def test_the_microphone_hears_a_tone(stage: Stage) -> None:
    stage.client.send(15, 2, 1)
    stage.robot.microphone.tone(stage.clock.now() + 0.5, 1000, 0.5)
    stage.run(2.0)
    samples = [int.from_bytes(stage.client.sound[at : at + 2], "little", signed=True)
               for at in range(0, len(stage.client.sound), 2)]
    assert len(samples) == pytest.approx(2.0 * 16000, abs=2001)
    loud = [index for index, value in enumerate(samples) if abs(value) > 3000]
    assert (loud[-1] - loud[0]) / 16000 == pytest.approx(0.5, abs=0.01)
    part = samples[loud[0] : loud[-1]]
    crossings = sum(1 for a, b in zip(part, part[1:], strict=False) if a < 0 <= b)
    assert crossings / (len(part) / 16000) == pytest.approx(1000, rel=0.01)


def test_it_finds_its_dock_charges_and_leaves_it(stage: Stage) -> None:
    stage.wire.write(bytes.fromhex("50 4b 10 00 01 06"))
    stage.run(25.0)
    assert stage.client.engine == [2]
    assert stage.client.powers[-1] < 0
    stage.client.send(5, 60, 60)
    stage.run(1.0)
    assert stage.robot.body.speeds == [0.0, 0.0]
    stage.wire.write(bytes.fromhex("50 4b 10 00 01 05"))
    stage.run(3.0)
    assert stage.client.engine == [2, 1]
    assert stage.client.powers[-1] > 0
    assert math.hypot(stage.robot.body.x + 1.75, stage.robot.body.y) > 0.05


def test_a_search_can_be_cancelled(stage: Stage) -> None:
    stage.client.send(16, 6)
    stage.run(2.0)
    stage.client.send(16, 7)
    stage.run(1.0)
    assert (stage.robot.body.speeds, stage.client.engine) == ([0.0, 0.0], [])


def test_an_upload_is_kept_played_and_its_end_told(stage: Stage) -> None:
    stage.client.send(6, 64, 1, bytes(10_000))
    stage.client.send(6, 64, 0, b"\x01" * 10_000)
    assert stage.robot.files == {}
    stage.client.send(6, 64, 2, b"\x02" * 12_000)
    assert stage.robot.files[64] == bytes(10_000) + b"\x01" * 10_000 + b"\x02" * 12_000
    stage.client.send(7, 64)
    stage.run(1.5)
    assert stage.client.ended == 0
    stage.run(1.0)
    assert stage.client.ended == 1


def test_configuration_networks_and_log(stage: Stage) -> None:
    stage.client.send(13, b"a=1&b=2")
    for kind in (13, 14, 17):
        stage.client.send(kind)
    stage.client.listen(0.2)
    assert stage.client.texts[13].endswith("a=1&b=2")
    assert stage.client.texts[14].startswith("home:WPA:70;")
    assert stage.client.texts[17].splitlines() == stage.robot.log_lines


def test_the_loudspeaker_plays_only_while_its_stream_is_on(stage: Stage) -> None:
    stage.client.send(1, bytes(4000))
    assert len(stage.robot.speaker.record()) == 0
    stage.client.send(15, 3, 1)
    stage.client.send(1, bytes(4000))
    stage.client.send(1, bytes(4000))
    assert (len(stage.robot.speaker.record()), stage.robot.speaker.gaps()) == (4000, [])


def test_what_is_no_packet_ends_the_connection(stage: Stage) -> None:
    stage.wire.write(b"GET / HTTP/1.0\r\n")
    assert stage.closed == 1
