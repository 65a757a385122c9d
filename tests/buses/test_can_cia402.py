"""Drives after CiA 402: found, walked through their states, aimed, lost, found again; and once over a virtual bus."""

from __future__ import annotations

import time
from typing import Any

import can
import pytest

from urbihw.buses import messages as m
from urbihw.buses import open as open_port
from urbihw.buses.can import cia402 as c
from urbihw.buses.can.drive import DriveInfo
from urbihw.buses.can.drives import DrivesDriver
from urbihw.buses.can.emergencies import advised
from urbihw.buses.errors import BadUrl, LinkGone, Unavailable
from urbihw.buses.link import Context, Url
from urbihw.buses.pipe import PipeLink
from urbihw.settings import BadSetting
from urbihw_fakes.can.node import CanFrame
from urbihw_fakes.cia402.dictionary import INCREMENTS
from urbihw_fakes.cia402.node import Drive

from .can_rig import Rig

TURN = INCREMENTS
INFO = DriveInfo(5, "Fake Servo 4096", 0x2D, TURN, -100 * TURN, 100 * TURN, 20 * TURN, 1.27, True)


@pytest.fixture
def rig() -> Rig:
    """A drive that is on."""
    made = Rig().attach().run(0.1)
    assert made.ask("enable", seconds=0.2).ok
    made.run(0.1)
    return made


# ---------------------------------------------------------------- the tables


@pytest.mark.parametrize(
    ("status", "state"),
    [
        (0x0250, "switch on disabled"),
        (0x0231, "ready to switch on"),
        (0x0633, "switched on"),
        (0x1637, "operation enabled"),
        (0x0217, "quick stop active"),
        (0x021F, "fault reaction active"),
        (0x0218, "fault"),
        (0x0000, "not ready to switch on"),
    ],
)
def test_states_by_status_word(status: int, state: str) -> None:
    assert c.state_of(status) == state


def test_the_way_to_power_and_back() -> None:
    way = (c.DISABLED, c.READY, c.SWITCHED_ON, c.ENABLED)
    assert [c.control_towards(True, state) for state in way] == [6, 7, 15, 15]
    assert c.control_towards(False, c.ENABLED) == 6
    assert c.control_towards(True, c.FAULT) is None


# ---------------------------------------------------------------- finding


def test_a_drive_is_found_and_tells_of_itself_and_nothing_is_switched_on() -> None:
    rig = Rig().attach()
    assert rig.take(m.Found) == [m.Found((INFO,))]
    rig.run(2.0)
    assert rig.drive.machine.state == c.DISABLED
    assert rig.drive.machine.position == 0
    assert rig.values() == {"status": 0x0250, "mode": 0, "position": 0, "velocity": 0, "torque": 0}
    assert not any(frame.id == 0x205 for frame in rig.port.sent)


def test_several_drives_and_what_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    other = Drive(9)
    monkeypatch.setattr(other, "_read", lambda index, subindex, od: None)
    third = Drive(20)
    third._node.object_dictionary[0x1000].default = 0x00000191
    rig = Rig(Drive(5), other, third).attach()
    assert [info.id for found in rig.news if isinstance(found, m.Found) for info in found.devices] == [5, 9]
    (problem,) = rig.take(m.DeviceReport)
    assert "node 20 is no drive after CiA 402 (device type 0x00000191)" in problem.value


def test_only_the_configured_nodes_are_looked_for() -> None:
    rig = Rig(Drive(5), Drive(6), options={"nodes": [6]}).attach()
    assert [info.id for info in rig.take(m.Found)[0].devices] == [6]


def test_nobody_there_is_unavailable() -> None:
    rig = Rig()
    rig.drive.power_off(0)
    with pytest.raises(Unavailable, match="no node answers on can://pipe/rig"):
        rig.attach()


def test_a_drive_that_cannot_be_mapped_says_so() -> None:
    rig = Rig()
    del rig.drive._node.object_dictionary[0x1A00]
    with pytest.raises(Unavailable, match="drive 5 cannot be set up: .*Object does not exist"):
        rig.attach()


def test_a_drive_that_tells_little_is_taken_as_it_is() -> None:
    rig = Rig()
    for index in (0x607D, 0x607F, 0x608F, 0x1016, 0x1008):
        del rig.drive._node.object_dictionary[index]
    rig.drive._heartbeat_consumer = lambda: (0, 0.0)  # type: ignore[method-assign]
    (info,) = rig.attach().take(m.Found)[0].devices
    assert (info.name, info.watches, info.low, info.most_speed) == ("", False, -float("inf"), float("inf"))


@pytest.mark.parametrize("options", [{"nodes": "all"}, {"nodes": [0]}, {"nodes": [127]}, {"colour": 1}])
def test_options_without_sense(options: dict[str, Any]) -> None:
    with pytest.raises(BadSetting, match=f"^options.{next(iter(options))}: "):
        DrivesDriver().configure(m.Configure(options=options))


def test_a_byte_link_is_no_can_bus() -> None:
    pipe = PipeLink(Url.parse("pipe://x"), Context())
    with pytest.raises(BadUrl, match="is no CAN bus"):
        DrivesDriver().attach(pipe)


# ---------------------------------------------------------------- moving


def test_it_turns_and_halts(rig: Rig) -> None:
    rig.aim("velocity", 2 * TURN)
    rig.run(1.0)
    assert rig.values()["velocity"] == 2 * TURN
    rig.driver.safe_stop()
    rig.run(0.5)
    assert rig.values()["velocity"] == 0
    assert rig.drive.machine.state == c.ENABLED
    rig.aim("velocity", -TURN)
    rig.run(1.0)
    assert rig.values()["velocity"] == -TURN


def test_it_goes_to_positions_one_after_the_other(rig: Rig) -> None:
    for place in (TURN, -TURN, 0):
        rig.aim("position", place)
        rig.run(3.0)
        assert rig.values()["position"] == pytest.approx(place, abs=3)
    assert rig.values()["mode"] == c.POSITION


def test_positions_in_quick_succession_end_at_the_last(rig: Rig) -> None:
    for place in range(0, TURN, 64):
        rig.aim("position", place)
        rig.run(0.01)
    rig.run(2.0)
    assert rig.values()["position"] == pytest.approx(TURN - 64, abs=3)


def test_modes_alternate(rig: Rig) -> None:
    rig.aim("velocity", TURN)
    rig.run(0.5)
    rig.aim("position", 0)
    rig.run(3.0)
    assert rig.values()["position"] == pytest.approx(0, abs=3)
    rig.aim("velocity", TURN)
    rig.run(0.5)
    assert rig.values()["velocity"] == TURN


def test_a_drive_that_is_off_forgets_its_targets() -> None:
    rig = Rig().attach().run(0.1)
    rig.aim("velocity", TURN)
    rig.run(0.2)
    assert rig.ask("enable").ok
    rig.run(1.0)
    assert rig.drive.machine.position == 0


def test_targets_without_sense_are_refused(rig: Rig) -> None:
    for item, value in (("torque", 1 << 15), ("velocity", 0.5), ("position", 1 << 31)):
        rig.aim(item, value)
    assert len(rig.take(m.Refused)) == 3


# ---------------------------------------------------------------- states


def test_on_off_and_quick_stop(rig: Rig) -> None:
    assert rig.ask("disable") == m.Reply(7, True, c.READY)
    assert rig.ask("enable") == m.Reply(7, True, c.ENABLED)
    rig.aim("velocity", 5 * TURN)
    rig.run(1.0)
    assert rig.ask("quick_stop").ok
    assert (rig.drive.machine.speed, rig.drive.machine.state) == (0.0, c.DISABLED)


def test_a_fault_is_told_and_reset_without_moving(rig: Rig) -> None:
    rig.aim("velocity", TURN)
    rig.run(0.5)
    rig.drive.fault(0x2310)
    rig.run(0.1)
    assert rig.values()["status"] & 0x4F == 0x08
    assert rig.take(m.DeviceReport) == [m.DeviceReport(5, "emergency", (0x2310, 1))]
    assert rig.ask("enable") == m.Reply(7, False, None, f"drive 5 stays in {advised('fault', 5)}")
    rig.run(3.0)
    reply = rig.ask("reset")
    assert reply.ok
    assert rig.drive.machine.state in (c.DISABLED, c.READY)
    place = rig.drive.machine.position
    assert rig.ask("enable").ok
    rig.run(1.0)
    assert rig.drive.machine.position == pytest.approx(place, abs=1)


def test_a_stop_may_switch_off() -> None:
    rig = Rig(torque_off_on_stop=True).attach().run(0.1)
    assert rig.ask("enable").ok
    rig.aim("velocity", TURN)
    rig.run(0.5)
    rig.driver.safe_stop()
    rig.run(0.5)
    assert (rig.drive.machine.speed, rig.drive.machine.state) == (0.0, c.DISABLED)


def test_a_wish_gives_way_to_the_next(rig: Rig) -> None:
    rig.driver.request(m.Request(1, "disable", 5))
    assert rig.driver.request(m.Request(2, "enable", 5)) == [m.Reply(1, False, None, "disable gave way to enable")]


def test_objects_are_read_and_written(rig: Rig) -> None:
    assert rig.ask("write", "6081", TURN, 0.1) == m.Reply(7, True, TURN)
    assert rig.ask("read", "6081", seconds=0.1).value == TURN
    assert rig.ask("read", "607D:2", seconds=0.1).value == 100 * TURN
    for verb, item, value in (("read", "2999", 0), ("read", "x", 0), ("write", "6081", "fast"), ("write", "6502", 1)):
        assert not rig.ask(verb, item, value, 0.5).ok
    assert "does not know" in rig.ask("sing", seconds=0.1).error
    assert "is not there" in rig.ask("enable", number=6, seconds=0.1).error


# ---------------------------------------------------------------- losing and finding


def test_a_master_that_dies_leaves_a_drive_that_brakes(rig: Rig) -> None:
    rig.aim("velocity", 2 * TURN)
    rig.run(2.0)
    now = rig.clock.now()
    for step in range(200):
        rig.drive.tick(now + step / 100)
    assert (rig.drive.machine.speed, rig.drive.machine.state) == (0.0, c.DISABLED)


def test_a_silent_drive_is_lost_and_the_others_go_on() -> None:
    rig = Rig(Drive(5), Drive(6)).attach().run(0.1)
    rig.take(m.DeviceState)
    rig.drive.power_off(rig.clock.now())
    rig.run(1.0)
    assert rig.take(m.DeviceState) == [m.DeviceState(5, "ok", "lost", "it says nothing")]
    rig.run(0.1)
    assert set([news for news in rig.news if isinstance(news, m.Samples)][-1].values) == {6}
    assert rig.ask("enable", number=6).ok


def test_a_drive_that_started_anew_is_set_up_again_and_stays_off(rig: Rig) -> None:
    rig.take(m.DeviceState)
    rig.aim("velocity", TURN)
    rig.run(0.5)
    rig.drive.power_off(rig.clock.now())
    rig.run(1.0)
    rig.drive.power_on(rig.clock.now())
    rig.run(1.0)
    assert [state.new for state in rig.take(m.DeviceState)] == ["lost", "back", "ok"]
    rig.run(1.0)
    assert (rig.drive.machine.state, rig.drive.machine.position) == (c.DISABLED, 0)
    assert rig.values()["position"] == 0


def test_a_short_break_of_power_is_noticed_too(rig: Rig) -> None:
    rig.take(m.DeviceState)
    rig.drive.power_off(rig.clock.now())
    rig.drive.power_on(rig.clock.now())
    rig.run(0.5)
    states = rig.take(m.DeviceState)
    assert [state.new for state in states] == ["lost", "back", "ok"]
    assert states[0].reason == "it has started anew"


def test_a_drive_taken_away_that_cannot_be_set_up_brakes_and_is_tried_again(rig: Rig) -> None:
    rig.take(m.DeviceState)
    rig.aim("velocity", TURN)
    rig.run(0.5)
    objects = rig.drive._node.object_dictionary
    mapping = objects[0x1A00]
    del objects[0x1A00]
    rig.drive.receive_frame(CanFrame(0, b"\x02\x05"), rig.clock.now())
    rig.run(1.0)
    assert rig.drive.machine.speed == 0.0
    reason = "another master on the bus has put it into STOPPED"
    assert rig.take(m.DeviceState) == [m.DeviceState(5, "ok", "lost", reason)]
    objects.add_object(mapping)
    rig.run(1.0)
    assert [state.new for state in rig.take(m.DeviceState)] == ["back", "ok"]
    assert rig.ask("enable").ok


def test_a_drive_that_was_left_in_stopped_is_found_and_braked(rig: Rig) -> None:
    rig.aim("velocity", TURN)
    rig.run(0.5)
    rig.driver.detach()
    # It does not watch a master here, so it turns on.
    rig.drive._node.set_data(0x1016, 1, bytes(4))
    rig.drive.receive_frame(CanFrame(0, b"\x02\x05"), rig.clock.now())
    rig.take(m.Found)
    assert rig.attach().take(m.Found) == [m.Found((INFO,))]
    assert rig.drive.machine.speed > 0
    assert rig.driver.stop_what_moves() == (5,)
    rig.run(0.5)
    assert (rig.drive.machine.speed, rig.drive.machine.state) == (0.0, c.DISABLED)


@pytest.mark.parametrize("method", [10**9, "x", None, float("nan")])
def test_a_homing_method_that_is_none_is_refused(rig: Rig, method: Any) -> None:
    assert "refuses homing method" in rig.ask("home", value=method, seconds=0.1).error


def test_a_link_that_was_away_moves_nothing(rig: Rig) -> None:
    rig.aim("velocity", TURN)
    rig.run(0.5)
    rig.driver.request(m.Request(3, "disable", 5))
    rig.port.dead = True
    with pytest.raises(LinkGone):
        rig.run(0.1)
    rig.driver.detach()
    rig.run(0.1)
    assert [reply.error for reply in rig.take(m.Reply)] == ["the link went down"]
    for _ in range(100):
        rig.clock.sleep_until(rig.clock.now() + 0.02)
        rig.drive.tick(rig.clock.now())
    rig.attach().run(1.0)
    assert rig.drive.machine.speed == 0.0
    assert rig.values()["status"] & 0x6F != 0x27


def test_a_full_bus_is_counted(rig: Rig) -> None:
    rig.port.full = True
    rig.run(0.5)
    assert rig.driver.errors()["unsent"] >= 4


def test_messages_without_sense_are_counted(rig: Rig) -> None:
    for identifier in (0x185, 0x285, 0x085, 0x705, 0x585, 0x000):
        for data in (b"", b"\x01", b"\xff" * 8):
            rig.port._coming.append((0.0, CanFrame(identifier, data)))  # type: ignore[arg-type]
    rig.run(0.3)
    assert rig.driver.errors()["damaged"] > 0
    rig.run(1.0)
    assert rig.ask("disable").ok or rig.take(m.DeviceState)


# ---------------------------------------------------------------- a real bus of python-can


class Served(can.Listener):
    """A drive at the far end of a virtual bus."""

    def __init__(self, bus: can.BusABC, drive: Drive) -> None:
        self._bus = bus
        self._drive = drive

    def on_message_received(self, message: can.Message) -> None:
        now = time.monotonic()
        frames = self._drive.tick(now)
        frames += self._drive.receive_frame(CanFrame(message.arbitration_id, bytes(message.data)), now)
        for _, frame in frames:
            self._bus.send(can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=False))


def test_over_a_virtual_bus() -> None:
    with can.Bus("drives", "virtual") as far, open_port("can://virtual/drives") as port:
        drive = Drive(5)
        notifier = can.Notifier(far, [Served(far, drive)], timeout=0.05)
        try:
            driver = DrivesDriver()
            driver.configure(m.Configure(options={"nodes": [5]}))
            (found,) = driver.attach(port)
            assert found == m.Found((INFO,))
            driver.request(m.Request(1, "enable", 5))
            news = _until(driver, lambda news: any(isinstance(one, m.Reply) for one in news))
            assert [one for one in news if isinstance(one, m.Reply)] == [m.Reply(1, True, c.ENABLED)]
            driver.targets(m.Targets({(5, "velocity"): TURN}))
            _until(driver, lambda news: _speeds(news)[-1:] == [TURN])
            driver.safe_stop()
            _until(driver, lambda news: _speeds(news)[-1:] == [0])
        finally:
            notifier.stop()


def _speeds(news: list[m.FromWorker]) -> list[int]:
    return [one.values[5]["velocity"] for one in news if isinstance(one, m.Samples)]


def _until(driver: DrivesDriver, done: Any) -> list[m.FromWorker]:
    news: list[m.FromWorker] = []
    end = time.monotonic() + 20
    while not done(news):
        assert time.monotonic() < end, "it did not happen in time"
        news += driver.tick(time.monotonic(), lambda: None)
    return news
