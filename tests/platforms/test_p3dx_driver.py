"""The drivers of both wires against the fake, in simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

import pytest
from driver_rig import START, DriverRig

from urbihw.buses.driver import Driver
from urbihw.buses.errors import LinkGone, Unavailable
from urbihw.buses.health import HealthRecord
from urbihw.buses.messages import Begin, Configure, Found, FromWorker, Refused, Reply, Samples, Watch
from urbihw.buses.verdict import judge
from urbihw.navigation.lasers.driver import LaserInfo
from urbihw.navigation.lasers.lms200driver import SickDriver
from urbihw.platforms.p3dx.driver import ArcosDriver
from urbihw.platforms.p3dx.protocol import command
from urbihw.settings import BadSetting
from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.sips import Settings
from urbihw_fakes.p3dx.world import World

TICK = 0.01


class Bench(DriverRig):
    """The driver of the base and its fake."""

    driver_class: ClassVar[type[Driver]] = ArcosDriver
    url = "pipe://robot?baud=115200"
    tick = TICK

    def order(self, item: str, value: Any) -> list[Any]:
        """Write a target of the base."""
        return self.write({("robot", item): value})

    def ask(self, verb: str, item: str = "", value: Any = 0, device: str = "robot") -> list[Any]:
        """Send a request."""
        return self.send_request(verb, device, item, value, 7)


class LaserBench(Bench):
    """The driver of the laser and its fake."""

    driver_class = SickDriver


def robot(kit: Kit | None = None, **settings: Any) -> tuple[Bench, Kit]:
    kit = kit if kit is not None else Kit(World(), slip=0)
    return Bench(kit.robot, **settings), kit


def ready(kit: Kit | None = None, **settings: Any) -> tuple[Bench, Kit]:
    """Connected, motors on."""
    bench, kit = robot(kit, **settings)
    bench.attach()
    bench.ask("write", "enable", 1)
    assert Reply(7, True, 1) in bench.run(0.5)
    return bench, kit


def values(news: list[FromWorker], device: str) -> dict[str, Any]:
    """The latest items of a device."""
    found: dict[str, Any] = {}
    for message in news:
        if isinstance(message, Samples):
            found.update(message.values.get(device, {}))
    return found


def orders(kit: Kit, number: int) -> list[int]:
    return [order.value for order in kit.robot.orders if order.number == number]


# --- connecting -------------------------------------------------------------------------------------------------------


def test_connecting_finds_names_and_configuration() -> None:
    bench, _ = robot()
    (found,) = bench.attach().news
    assert isinstance(found, Found)
    (info,) = found.devices
    assert (info.name, info.kind, info.subclass) == ("fake", "Pioneer", "p3dx-sh")
    assert info.config["serial"] == "SIM1" and info.config["firmware"] == "2.0"


def test_connecting_moves_nothing_and_switches_no_motor_on() -> None:
    bench, kit = robot()
    bench.attach()
    news = bench.run(1.0)
    assert values(news, "robot")["flags"] & 1 == 0
    assert {order.number for order in kit.robot.orders} <= {0, 11, 18, 21, 29}
    assert orders(kit, 11) == [0, 0, 0] == orders(kit, 21)


def test_nobody_answers() -> None:
    bench, kit = robot()
    kit.robot.power_off(0)
    with pytest.raises(Unavailable, match="is it switched on"):
        bench.attach()
    assert bench.clock.now() < START + 3


def test_a_connection_left_open_is_closed_and_its_motion_does_not_come_back() -> None:
    bench, kit = ready()
    bench.order("vel", 200)
    bench.run(2.0)
    bench.clock.sleep_until(bench.clock.now() + 3)
    assert kit.body.halted and not kit.body.moving
    where = kit.body.pose[0]
    bench.driver.detach()
    bench.link.close()
    again = Bench(kit.robot)
    again.clock.sleep_until(bench.clock.now())
    again.attach()
    again.run(2.0)
    assert kit.body.pose[0] == pytest.approx(where, abs=0.01)
    assert not kit.body.moving


@pytest.mark.parametrize("fault, times", [("silence", 1), ("checksum", 1), ("cut", 1), ("noise", 3)])
def test_a_handshake_survives_a_fault(fault: str, times: int) -> None:
    bench, kit = robot()
    kit.robot.faults.start(fault, times=times)
    assert isinstance(bench.attach().news[0], Found)


def test_a_controller_out_of_step_is_counted_in_again() -> None:
    bench, kit = robot()
    kit.robot.feed(command(0), 49.9)
    kit.robot.feed(command(1), 49.9)
    assert isinstance(bench.attach().news[0], Found)


def test_old_firmware_tells_no_configuration() -> None:
    kit = Kit(World())
    kit.robot._execute_command = lambda heard, now: []  # type: ignore[method-assign]
    bench, _ = robot(kit)
    (found,) = bench.attach().news
    assert isinstance(found, Found)
    assert found.devices[0].config["subclass"] == "" and found.devices[0].config["trans_vel_max"] == 0


@pytest.mark.parametrize(
    "options", [{"colour": 1}, {"laser": 3}, {"host_baud": 1200}, {"localization": "gps"}, {"cell": 0}, {"cell": True}]
)
def test_options_without_sense(options: dict[str, Any]) -> None:
    with pytest.raises(BadSetting, match=f"^options.{next(iter(options))}: "):
        ArcosDriver().configure(Configure(options=options))


# --- driving ----------------------------------------------------------------------------------------------------------


def test_speeds_reach_the_robot_and_positions_come_back() -> None:
    bench, kit = ready()
    bench.order("vel", 200)
    bench.order("rvel", -10)
    news = bench.run(3.0)
    assert kit.body.forward.speed == pytest.approx(0.2)
    seen = values(news, "robot")
    assert (seen["left"] + seen["right"]) / 2 == pytest.approx(200, abs=1)
    assert seen["x"] > 300 and seen["y"] < 0 and seen["theta"] < -200
    assert seen["moving"]


def test_a_set_point_is_repeated_and_so_is_a_stop() -> None:
    bench, kit = ready()
    bench.order("vel", 100)
    bench.run(1.05)
    assert len([value for value in orders(kit, 11) if value == 100]) in (5, 6)
    bench.order("vel", 0)
    bench.run(2.0)
    assert orders(kit, 11)[-4:] == [100, 0, 0, 0]


def test_a_lost_stop_stops_all_the_same() -> None:
    bench, kit = ready()
    bench.order("vel", 300)
    bench.run(2.0)
    bench.order("vel", 0)
    hear, kit.robot.receive = kit.robot.receive, lambda data, now: []  # type: ignore[method-assign]
    bench.run(0.1)
    kit.robot.receive = hear  # type: ignore[method-assign]
    bench.run(2.0)
    assert not kit.body.moving


def test_a_resting_robot_hears_a_pulse_twice_a_second() -> None:
    bench, kit = ready()
    bench.run(2.0)
    before = len(orders(kit, 0))
    bench.run(4.0)
    assert 7 <= len(orders(kit, 0)) - before <= 8
    assert not kit.body.halted


@pytest.mark.parametrize("item, value, why", [("fly", 1, "no such target"), ("vel", 1.5, "no speed"),
                                              ("rvel", 99999, "no speed")])  # fmt: skip
def test_targets_without_sense_are_refused(item: str, value: Any, why: str) -> None:
    bench, _ = ready()
    (refused,) = bench.order(item, value)
    assert isinstance(refused, Refused) and why in refused.reason


def test_without_motors_there_is_no_speed() -> None:
    bench, _ = robot()
    bench.attach()
    bench.run(0.3)
    (refused,) = bench.order("vel", 100)
    assert isinstance(refused, Refused) and "motors are off" in refused.reason
    assert bench.order("vel", 0) == []


def test_motors_that_come_back_bring_no_speed_with_them() -> None:
    bench, kit = ready()
    bench.order("vel", 200)
    bench.run(1.0)
    kit.robot.press_stop_button(True)
    bench.run(0.5)
    kit.robot.press_stop_button(False)
    bench.ask("write", "enable", 1)
    bench.run(1.0)
    assert kit.body.motors and not kit.body.moving


def test_a_pressed_button_is_told() -> None:
    bench, kit = robot()
    bench.attach()
    kit.robot.press_stop_button(True)
    bench.ask("write", "enable", 1)
    (answer,) = [message for message in bench.run(3.0) if isinstance(message, Reply)]
    assert not answer.ok and "STOP button" in answer.error
    assert len(orders(kit, 4)) == 4


def test_the_health_hears_of_the_button_and_of_a_battery_below_the_threshold_of_the_controller() -> None:
    bench, kit = ready()

    def findings() -> list[str]:
        samples = [each for each in bench.run(0.3) if isinstance(each, Samples)]
        health = HealthRecord(bench.driver, Begin(Configure()), 0.0)
        for each in samples:
            health.hear(each, each.time)
        now = samples[-1].time
        return [str(each) for each in judge(health.fields(now, now, True) | {"link": True})]

    assert findings() == []
    kit.robot.press_stop_button(True)
    assert findings() == ["robot: alarm: its STOP button is pressed: release it, then P3dx.body.load = 1"]
    kit.robot.press_stop_button(False)
    kit.body.volts = 10.5
    assert findings() == ["robot: 10.5 V, below its limit of 11.5"]


def test_a_lost_switch_is_sent_again() -> None:
    bench, kit = robot()
    bench.attach()
    hear, kit.robot.receive = kit.robot.receive, lambda data, now: []  # type: ignore[method-assign]
    bench.ask("write", "enable", 1)
    bench.run(0.2)
    kit.robot.receive = hear  # type: ignore[method-assign]
    assert Reply(7, True, 1) in bench.run(1.0)


def test_a_switch_that_was_overtaken_is_answered() -> None:
    bench, kit = ready()
    bench.ask("write", "enable", 0)
    (answer,) = bench.ask("write", "enable", 1)
    assert isinstance(answer, Reply) and "overtaken" in answer.error
    bench.run(1.0)
    assert kit.body.motors


@pytest.mark.parametrize("torque_off", [False, True])
def test_a_safe_stop_is_a_stop(torque_off: bool) -> None:
    bench, kit = ready(torque_off_on_stop=torque_off)
    bench.order("vel", 300)
    bench.run(2.0)
    before = len(orders(kit, 29))
    bench.driver.safe_stop()
    bench.run(2.0)
    assert not kit.body.moving and kit.body.motors is not torque_off
    assert len(orders(kit, 29)) == before + 1


# --- what is measured -------------------------------------------------------------------------------------------------


def test_sonars_come_in_turn() -> None:
    bench, _ = robot(Kit())
    bench.attach()
    seen = values(bench.run(1.0), "sonar")
    assert set(seen) == {str(number) for number in range(16)}
    assert seen["0"] == pytest.approx(2864, abs=1)
    bench.ask("write", "sonar", 0)
    assert Reply(7, True, 0) in bench.run(0.5)


@pytest.mark.parametrize(
    "device, items", [("encoder", {"left", "right"}), ("io", {"digital_in", "digital_out", "analog"}),
                      ("gyro", {"rate", "temperature"}), ("joystick", {"x", "y", "button1", "button2", "throttle"}),
                      ("battery", {"batteries"}), ("laser", {"ranges"})]
)  # fmt: skip
def test_what_is_watched_comes_until_it_is_not(device: str, items: set[str]) -> None:
    bench, _ = robot()
    bench.attach()
    assert values(bench.run(0.5), device) == {}
    assert bench.driver.watch(Watch(device, tuple(items)), 0) == []
    assert values(bench.run(0.5), device).keys() == items
    bench.driver.watch(Watch(device, (), None), 0)
    bench.run(0.2)
    assert values(bench.run(0.5), device) == {}


def test_watches_outlive_the_link() -> None:
    bench, kit = robot()
    bench.driver.watch(Watch("encoder", ("left",)), 0)
    bench.attach()
    assert values(bench.run(0.5), "encoder")
    bench.driver.detach()
    kit.robot.power_off(bench.clock.now())
    kit.robot.power_on(bench.clock.now())
    bench.attach()
    assert values(bench.run(0.5), "encoder")


def test_there_is_nothing_else_to_watch() -> None:
    bench, _ = robot()
    (refused,) = bench.driver.watch(Watch("toaster", ("heat",)), 0)
    assert isinstance(refused, Refused)


def test_commands_and_questions() -> None:
    bench, kit = ready()
    assert bench.ask("write", "DIGOUT", 0x0100, "command") == [Reply(7, True)]
    bench.run(0.3)
    assert kit.robot.extras.digital_out == 0xFE
    (value,) = bench.ask("read", "digital_out")
    assert isinstance(value, Reply) and value.value == 0xFE
    for verb, device, item, value_, why in (
        ("write", "command", "VEL", 100, "driver only"), ("write", "command", "FLY", 1, "no command"),
        ("write", "command", "SAY", 1, "bytes"), ("read", "robot", "mood", 0, "nothing is known"),
        ("write", "robot", "mood", 0, "no request"), ("dance", "robot", "", 0, "no request"),
    ):  # fmt: skip
        (answer,) = bench.ask(verb, item, value_, device)
        assert isinstance(answer, Reply) and not answer.ok and why in answer.error


def test_damage_is_counted_and_costs_one_packet() -> None:
    bench, kit = robot()
    bench.attach()
    bench.run(0.5)
    kit.robot.faults.start("checksum", times=2)
    sips = [message for message in bench.run(1.0) if isinstance(message, Samples)]
    assert len(sips) == 8
    assert bench.driver.errors() == {"damaged": 2, "unreadable": 0, "incomplete": 0}


def test_positions_are_counted_on_over_a_new_connection() -> None:
    bench, kit = ready()
    bench.order("vel", 300)
    bench.run(3.0)
    bench.order("vel", 0)
    before = values(bench.run(2.0), "robot")["x"]
    bench.driver.detach()
    kit.robot.power_off(bench.clock.now())
    kit.robot.power_on(bench.clock.now())
    kit.body.odometry = (0.0, 0.0, 0.0)
    bench.attach()
    assert values(bench.run(0.5), "robot")["x"] == before


# --- losing it --------------------------------------------------------------------------------------------------------


def test_silence_is_a_lost_link() -> None:
    bench, kit = ready()
    kit.robot.power_off(bench.clock.now())
    with pytest.raises(LinkGone, match="silent"):
        bench.run(3.0)


@pytest.mark.parametrize("fault", ["checksum", "cut", "silence"])
def test_bytes_without_packets_are_no_sign_of_life(fault: str) -> None:
    bench, kit = ready()
    bench.order("vel", 200)
    bench.run(1.0)
    assert kit.body.forward.speed == pytest.approx(0.2)
    kit.robot.faults.start(fault)
    bench.run(0.4)
    assert kit.body.forward.speed == pytest.approx(0.2)
    assert bench.driver.halted == ""
    stops = len(orders(kit, 29))
    # Half a second from the last good packet, which is up to 0.1 s older than the fault.
    bench.run(0.12)
    assert bench.driver.halted == "the robot has said nothing for 0.5 s"
    assert len(orders(kit, 29)) == stops + 1
    bench.run(1.0)
    assert not kit.body.moving
    with pytest.raises(LinkGone, match="silent for 2 s"):
        bench.run(0.5)
    assert not kit.body.moving


def test_a_speed_that_is_asked_of_a_blind_robot_is_not_sent() -> None:
    bench, kit = ready()
    bench.order("vel", 200)
    bench.run(1.0)
    kit.robot.faults.start("checksum")
    bench.run(1.5)
    where = kit.body.pose
    driven = len(orders(kit, 11))
    for _ in range(20):
        bench.order("vel", 200)
        bench.run(TICK)
    assert {*orders(kit, 11)[driven:]} <= {0}
    assert kit.body.pose == where


def test_a_good_packet_in_time_keeps_it_driving() -> None:
    bench, kit = ready()
    bench.order("vel", 200)
    bench.run(1.0)
    for _ in range(8):
        # Four damaged ones, then a good one.
        kit.robot.faults.start("checksum", times=4)
        bench.run(0.5)
    assert bench.driver.halted == ""
    assert kit.body.forward.speed == pytest.approx(0.2)


def test_a_reset_is_a_lost_link() -> None:
    bench, kit = ready()
    bench.end.send(b"".join(answer.data for answer in kit.robot.reset(bench.clock.now())), bench.clock.now())
    with pytest.raises(LinkGone, match="was reset"):
        bench.run(0.1)


def test_questions_pending_at_the_loss_are_answered() -> None:
    bench, kit = ready()
    bench.ask("write", "enable", 0)
    bench.driver.detach()
    (answer,) = bench.ask("write", "SETO", None, "command")
    assert isinstance(answer, Reply) and "link is down" in answer.error
    kit.robot.power_off(bench.clock.now())
    kit.robot.power_on(bench.clock.now())
    assert Reply(7, False, error="the link went down") in bench.attach().news
    assert bench.driver.tick(bench.clock.now(), lambda: None) == []


def test_garbage_never_hurts() -> None:
    bench, _ = ready()
    bench.end.send(b"\xfa\xfb\x05\x32\x00\x00\x32\x00" + bytes(range(256)) * 4, bench.clock.now())
    bench.run(0.3)
    assert values(bench.run(0.3), "robot")
    assert sum(bench.driver.errors().values()) > 0


# --- the laser --------------------------------------------------------------------------------------------------------


def laser(kit: Kit | None = None) -> tuple[Bench, Kit]:
    kit = kit if kit is not None else Kit()
    return LaserBench(kit.laser), kit


def test_the_laser_scans_after_attaching() -> None:
    bench, _ = laser()
    assert bench.attach().news == [Found((LaserInfo(math.pi, math.radians(1)),))]
    seen = values(bench.run(1.0), "laser")
    assert len(seen["ranges"]) == 181
    assert seen["ranges"][0] == pytest.approx(3.0) and seen["ranges"][90] == pytest.approx(2.979)
    assert seen["farthest"] == pytest.approx(8.182) and not seen["dirty"]


def test_a_laser_left_scanning_is_found_again() -> None:
    bench, kit = laser()
    bench.attach()
    bench.run(1.0)
    bench.driver.detach()
    assert bench.attach()
    bench.driver.safe_stop()
    assert not kit.laser.scanning


def test_no_laser_answers() -> None:
    bench, kit = laser()
    kit.laser.power_off(0)
    with pytest.raises(Unavailable, match="no laser answers"):
        bench.attach()


def test_a_laser_that_refuses_says_so() -> None:
    bench, kit = laser()
    obey: Callable[[bytes, float], list[bytes]] = kit.laser._execute_command
    kit.laser._execute_command = lambda payload, now: [b"\x92"] if payload[0] == 0x3B else obey(payload, now)
    with pytest.raises(Unavailable, match="refused 3B B4 00 64 00"):
        bench.attach()


def test_a_silent_laser_is_lost_and_damage_is_counted() -> None:
    bench, kit = laser()
    bench.attach()
    kit.laser.faults.start("checksum", times=1)
    bench.run(1.0)
    assert bench.driver.errors()["damaged"] >= 1
    kit.laser.power_off(0)
    with pytest.raises(LinkGone, match="laser has sent no scan"):
        bench.run(4.0)


def test_a_laser_takes_no_wishes() -> None:
    bench, _ = laser()
    assert isinstance(bench.order("vel", 1)[0], Refused)
    assert isinstance(bench.ask("read")[0], Reply)
    assert bench.driver.watch(Watch("laser", ()), 0) == []


def test_other_subclasses_come_through() -> None:
    bench, _ = robot(Kit(World(), settings=Settings(subclass="p3at-sh", name="Sim")))
    (found,) = bench.attach().news
    assert isinstance(found, Found) and found.devices[0].subclass == "p3at-sh"
