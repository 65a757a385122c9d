"""The driver of a Spykee: login, the order of things, speeds that are sent again, bulk data that waits its turn."""

from __future__ import annotations

import logging
from typing import Any, Self

import pytest
from driver_rig import DriverRig
from spykee_lab import Lab

from urbihw.buses.errors import BadValue, LinkGone, Unavailable
from urbihw.buses.messages import DeviceReport, Found, Reply, Request, Samples, Targets, Watch
from urbihw.buses.pipe import PipeLink
from urbihw.platforms.spykee import bulk, session
from urbihw.platforms.spykee import driver as d
from urbihw.platforms.spykee import protocol as p
from urbihw.platforms.spykee.tracks import RESEND_PERIOD_S, ZEROS
from urbihw.settings import BadSetting
from urbihw_fakes.spykee.device import Spykee

TICK = DriverRig.tick


class SlowLink(PipeLink):
    """A link of which a test says whether it takes bytes."""

    free = True

    def is_writable(self) -> bool:
        return self.free


class Rig(DriverRig):
    """A driver, a robot, and what went over the wire."""

    driver_class = d.SpykeeDriver
    link_class = SlowLink
    driver: d.SpykeeDriver
    link: SlowLink

    def __init__(self, robot: Spykee | None = None, **options: Any) -> None:
        self.robot = Spykee() if robot is None else robot
        self.written: list[tuple[float, bytes]] = []
        super().__init__(self.robot, options=options)
        self.end.on_open = self.robot.connect
        self.robot.on_close = self.end.hang_up

    def receive(self, data: bytes, at: float) -> None:
        self.written.append((at, data))
        super().receive(data, at)

    def attach(self) -> Self:
        """Log in."""
        super().attach()
        self.written.clear()
        return self

    def drive(self, **speeds: int) -> None:
        """Write speeds of tracks."""
        assert self.write({(track, "speed"): speed for track, speed in speeds.items()}) == []

    def moves(self) -> list[bytes]:
        """The moves that were written since the last call."""
        found = [data for _, data in self.written if data[2] == p.MOVE]
        self.written.clear()
        return found


# ---------------------------------------------------------------- login


def test_it_logs_in_waits_for_the_battery_and_only_then_may_be_moved() -> None:
    rig = Rig()
    rig.link.open()
    news = rig.driver.attach(rig.link)
    assert news[0] == Found((session.SpykeeRobotInfo("SPYKEE0011223344", "Spykee", "1.0.34", False, 87),))
    assert isinstance(news[1], Samples) and news[1].values == {d.POWER: {"level": 87}}
    assert [data[2] for _, data in rig.written] == [p.LOGIN]
    # The robot hangs up when it is moved too early; it has not.
    rig.drive(trackL=50)
    rig.run(1.0)
    assert rig.robot.body.speeds[0] > 0.2


def test_a_refusal_is_told_from_silence_and_neither_tells_the_password() -> None:
    with pytest.raises(Unavailable, match="refuses user 'admin': wrong user .*, or somebody else") as caught:
        Rig(Spykee(password="other"), password="hush-hush").attach()
    assert "hush-hush" not in str(caught.value)
    rig = Rig()
    rig.robot.faults.start("silence")
    with pytest.raises(Unavailable, match="no answer to the login in 2 s; is this a Spykee?"):
        rig.attach()


def test_a_line_that_is_closed_at_the_login_is_a_refusal() -> None:
    rig = Rig()
    rig.robot.receive = lambda data, now: rig.end.hang_up() or []  # type: ignore[method-assign, func-returns-value]
    with pytest.raises(Unavailable, match="refuses user 'admin'"):
        rig.attach()


def test_something_else_at_that_port_is_said() -> None:
    rig = Rig()
    rig.robot.receive = lambda data, now: rig.end.send(b"SSH-2.0-OpenSSH", now) or []  # type: ignore[method-assign, func-returns-value]
    with pytest.raises(Unavailable, match="are no packets; is this a Spykee?"):
        rig.attach()


def test_the_password_is_in_no_message_of_the_settings() -> None:
    for wrong in ("x" * 256, "hush\u20ac", ["hush"]):
        with pytest.raises(BadSetting) as caught:
            Rig(password=wrong)
        assert "hush" not in str(caught.value) and "xxx" not in str(caught.value)
    assert Rig(password=1234).driver._options.password == "1234"
    assert "1234" not in repr(Rig(password=1234).driver._options)


def test_a_refused_login_is_one_line_in_the_log_without_the_password(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    lab = Lab(Spykee(password="other"), password="hush-hush")
    lab.until(lambda: bool(lab.opened))
    assert "refuses user 'admin'" in str(lab.opened[0])
    assert "hush-hush" not in caplog.text + str(lab.opened[0])


# ---------------------------------------------------------------- motion


def test_a_wanted_speed_is_sent_at_once_and_again_and_again() -> None:
    rig = Rig().attach()
    rig.drive(trackL=60, trackR=-60)
    rig.run(TICK)
    assert rig.moves() == [p.move(60, -60)]
    rig.run(1.0 - TICK)
    assert len(rig.moves()) == pytest.approx(1.0 / RESEND_PERIOD_S, abs=1)
    rig.drive(trackL=0, trackR=0)
    rig.run(2.0)
    assert rig.moves() == [p.move(0, 0)] * ZEROS


def test_a_stop_is_written_at_once() -> None:
    rig = Rig().attach()
    rig.drive(trackL=60, trackR=60)
    rig.run(0.5)
    rig.moves()
    rig.driver.safe_stop()
    assert rig.moves() == [p.move(0, 0)]
    rig.drive(trackL=60, trackR=60)
    rig.run(0.1)
    rig.moves()
    rig.driver.safe_stop(("trackL",))
    assert rig.moves() == [p.move(0, 60)]


def test_nothing_is_known_of_what_the_robot_does_so_it_is_stopped_first() -> None:
    rig = Rig()
    rig.robot.body.drive(80, 80)
    rig.attach()
    assert rig.driver.stop_what_moves() == ()
    assert [data for _, data in rig.written] == [p.packet(p.ENGINE, bytes([p.CANCEL])), p.move(0, 0)]


def test_on_its_dock_it_is_left_alone_and_ends_a_search_by_a_stop_elsewhere() -> None:
    robot = Spykee()
    robot.body.put_on_dock()
    rig = Rig(robot).attach()
    rig.driver.stop_on_reconnect()
    assert [data for _, data in rig.written] == [p.move(0, 0)]
    rig = Rig().attach()
    assert rig.driver.request_moves(Request(1, "write", d.ENGINE, "move", p.DOCK))
    assert not rig.driver.request_moves(Request(1, "write", d.ENGINE, "move", p.CANCEL))
    assert rig.send_request("write", d.ENGINE, "move", p.DOCK) == [Reply(1, True)]
    rig.run(1.0)
    assert rig.robot.body.doing == "docking"
    rig.driver.safe_stop((d.ENGINE,))
    assert rig.robot.body.doing == ""


def test_the_dock_ends_what_was_wanted_of_the_tracks() -> None:
    rig = Rig().attach()
    rig.drive(trackL=60)
    rig.run(0.1)
    rig.robot.body.put_on_dock()
    news = rig.run(0.5)
    assert DeviceReport("dock", "docked") in news
    assert rig.driver.halted == "the robot is on its dock"
    assert rig.moves()[-1] == p.move(0, 0)


def test_no_repeated_standstill_ends_a_search() -> None:
    rig = Rig().attach()
    rig.drive(trackL=60)
    rig.run(0.1)
    rig.driver.safe_stop()
    rig.send_request("write", d.ENGINE, "move", p.DOCK)
    rig.run(1.0)
    assert rig.robot.body.doing == "docking"


def test_speeds_without_a_robot_are_forgotten() -> None:
    rig = Rig()
    rig.drive(trackL=60)
    rig.attach()
    rig.run(0.5)
    assert rig.moves() == []


@pytest.mark.parametrize(
    ("device", "item", "value"), [("trackL", "speed", 101), ("trackL", "speed", 0.5), ("trackX", "speed", 1),
                                  ("headLed", "on", 2), ("trackL", "on", 1)],
)  # fmt: skip
def test_targets_without_sense_are_refused(device: str, item: str, value: Any) -> None:
    rig = Rig().attach()
    refused: Any
    (refused,) = rig.driver.targets(Targets({(device, item): value}))
    assert "no such target, or no such value" in refused.reason
    rig.run(0.2)
    assert rig.written == []


# ---------------------------------------------------------------- what comes


def test_a_broken_stream_is_given_up() -> None:
    rig = Rig().attach()
    rig.end.send(b"noise", rig.clock.now())
    with pytest.raises(LinkGone, match="are no packets; connecting again"):
        rig.run(0.1)


def test_what_comes_in_one_piece_with_the_login_is_not_lost() -> None:
    rig = Rig()
    reply = p.packet(p.LOGIN_REPLY, b"\x01" + b"\x01a" * 4 + b"\x01")
    glued = reply + p.packet(p.POWER, b"\x50") + p.packet(p.ENGINE, bytes([p.IS_DOCKED])) + p.packet(p.POWER, b"\xb0")
    rig.robot.receive = lambda data, now: rig.end.send(glued, now) or []  # type: ignore[method-assign, func-returns-value]
    rig.attach()
    news = rig.run(TICK)
    assert DeviceReport("dock", "docked") in news
    assert news[-1].values == {d.POWER: {"level": -80}}


def test_lights_that_are_written_without_a_robot_do_not_pile_up() -> None:
    rig = Rig()
    for _ in range(1000):
        rig.driver.targets(Targets({("headLed", "on"): 1}))
        rig.driver.watch(Watch(d.CAMERA, (), 0.0), 0.0)
    rig.attach()
    rig.run(TICK)
    assert sum(len(data) for _, data in rig.written) == 14
    assert (rig.robot.leds[0], rig.robot._streams) == (1, {1})


def test_only_the_newest_picture_counts() -> None:
    rig = Rig().attach()
    for shade in range(3):
        rig.end.send(p.packet(p.VIDEO, bytes([shade])), rig.clock.now())
    (samples,) = [one for one in rig.run(TICK) if isinstance(one, Samples)]
    assert samples.values == {d.CAMERA: {"image": b"\x02"}}
    assert rig.driver.errors()["skipped"] == 2


def test_watches_outlive_the_connection() -> None:
    rig = Rig().attach()
    assert rig.driver.watch(Watch(d.CAMERA, ("val",), 0.0), rig.clock.now()) == []
    rig.run(TICK)
    assert rig.robot._streams == {1}
    rig.driver.detach()
    rig.link.close()
    rig.attach()
    assert rig.robot._streams == set()
    rig.run(TICK)
    assert rig.robot._streams == {1}
    rig.driver.watch(Watch(d.CAMERA, (), None), rig.clock.now())
    rig.run(TICK)
    assert rig.robot._streams == set()


def test_questions_are_answered_or_it_is_said_that_they_are_not() -> None:
    rig = Rig().attach()
    assert rig.send_request("read", "config", number=5) == rig.send_request("read", "config", number=6) == []
    news = rig.run(0.5)
    assert [reply.reply_id for reply in news if isinstance(reply, Reply)] == [5, 6]
    rig.robot.faults.start("silence")
    rig.send_request("read", "log", number=7)
    assert rig.run(d.ANSWER_TIMEOUT_S - 0.5) == []
    assert rig.run(1.0) == [Reply(7, False, error="the robot did not answer")]


@pytest.mark.parametrize(
    "request_", [("write", "play", "sound", 66), ("write", "play", "sound", 16), ("write", "engine", "move", 1),
                 ("write", "play", "volume", 101), ("write", "file", "firmware", 1), ("erase", "file", "", 0)],
)  # fmt: skip
def test_other_requests_are_refused(request_: tuple[str, str, str, int]) -> None:
    rig = Rig().attach()
    (reply,) = rig.send_request(*request_)
    assert not reply.ok and "knows no request" in reply.error
    assert rig.written == []


def test_what_waits_is_answered_when_the_link_goes() -> None:
    rig = Rig().attach()
    rig.link.free = False
    rig.send_request("read", "log", number=1)
    rig.send_request("write", "file", "chunk", (3, b"x"), number=2)
    rig.send_request("write", "speaker", "piece", bytes(4000), number=3)
    rig.driver.detach()
    news: list[Any] = rig.driver.tick(rig.clock.now(), lambda: None)
    assert {reply.reply_id: reply.error for reply in news} == dict.fromkeys((1, 2, 3), "the link went down")


# ---------------------------------------------------------------- bulk data


def upload(rig: Rig, count: int) -> None:
    for index in range(count):
        rig.send_request("write", "file", "chunk", (0, bytes(bulk.CHUNK_BYTES)), number=index)


def test_bulk_data_waits_while_the_link_takes_nothing_and_a_stop_does_not() -> None:
    rig = Rig().attach()
    upload(rig, 20)
    rig.drive(trackL=60)
    rig.run(0.1)
    rig.link.free = False
    rig.written.clear()
    rig.driver.safe_stop()
    rig.run(1.0)
    assert {data for _, data in rig.written} == {p.packet(p.ENGINE, bytes([p.CANCEL])), p.move(0, 0)}
    rig.link.free = True
    rig.run(1.0)
    assert len([data for _, data in rig.written if data[2] == p.FILE]) == 20 - d.PACKETS_PER_TICK * 5


def test_a_tick_sends_little_and_none_when_a_stop_has_come() -> None:
    rig = Rig().attach()
    upload(rig, 20)
    assert len(rig.driver.tick(rig.clock.now(), lambda: None)) == d.PACKETS_PER_TICK
    assert rig.driver.tick(rig.clock.now(), lambda: None, lambda: True) == []



def test_sound_is_sent_at_the_pace_at_which_it_is_played() -> None:
    rig = Rig().attach()
    for index in range(16):
        assert rig.send_request("write", "speaker", "piece", bytes(4000), number=index) == []
    (reply,) = rig.send_request("write", "speaker", "piece", bytes(4000), number=99)
    assert not reply.ok
    rig.run(0.5)
    sent = len(rig.robot.speaker.record()) / p.SOUND_RATE
    assert 0.5 + bulk.LEAD_S - 0.13 <= sent <= 0.5 + bulk.LEAD_S + 0.13
    rig.run(2.0)
    assert (len(rig.robot.speaker.record()), rig.robot.speaker.gaps()) == (32_000, [])
    assert rig.robot.speaker.on
    rig.run(1.0)
    assert not rig.robot.speaker.on


@pytest.mark.parametrize("pcm", [bytes(4002), bytes(3)])
def test_a_piece_of_sound_is_small_and_whole(pcm: bytes) -> None:
    (reply,) = Rig().attach().send_request("write", "speaker", "piece", pcm)
    assert "at most 4000 bytes" in reply.error


def test_a_key_that_cannot_be_sent_is_refused() -> None:
    (reply,) = Rig().attach().send_request("write", "config", "a=b", "c")
    assert not reply.ok
    with pytest.raises(BadValue):
        p.pair("a", "b&c")
