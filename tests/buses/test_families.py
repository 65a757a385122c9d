"""Servos of every family behind the driver: found, moved, turned, stopped; the body of the fake tells what happened."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from urbihw.buses.messages import Configure, Found, Reply, Request, Targets, Watch
from urbihw.buses.servos import tables
from urbihw.buses.servos.cycle import Cycle
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.driver import ServoDriver
from urbihw.buses.servos.item import ShaftMotion
from urbihw.buses.servos.scan import scan
from urbihw.buses.servos.stop import safe_stop, stop_what_moves
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.catalogue import UNITS, make_servos
from urbihw_fakes.dynamixel.servo import Servo1, Servo2, Shaft
from urbihw_fakes.dynamixel.xseries import XSeries

from .conftest import BAUD, Rig

MakeRig = Callable[[Bioloid], Rig]
JOINTS = [model for model in UNITS if model != "AX-S1"]
_SAME = {"AX-12": "AX-12A", "YM070-210-R099-RH": "YM070-210-R099"}

# Model, registers of the fake that select the mode, mode, effector, raw target (counter-clockwise), clockwise one.
TURNS: list[tuple[str, dict[str, int], str, str, int, int]] = [
    ("RX-28", {"low_limit": 0, "high_limit": 0}, "wheel", "moving_speed", 500, 1024 + 500),
    ("EX-106+", {"low_limit": 0, "high_limit": 0}, "wheel", "moving_speed", 500, 1024 + 500),
    ("MX-28", {"low_limit": 0, "high_limit": 0}, "wheel", "moving_speed", 300, 1024 + 300),
    ("MX-64", {"torque_control": 1}, "torque", "goal_torque", 300, 1024 + 300),
    ("XL-320", {"mode": 1}, "wheel", "moving_speed", 500, 1024 + 500),
    ("XM540-W270", {"operating_mode": 1}, "velocity", "goal_velocity", 100, -100),
    ("XM540-W270", {"operating_mode": 16}, "pwm", "goal_pwm", 400, -400),
    ("XH430-V350", {"operating_mode": 0}, "current", "goal_current", 300, -300),
    ("MX-106(2.0)", {"operating_mode": 1}, "velocity", "goal_velocity", 100, -100),
    ("PH54-200-S500-R", {"mode": 1}, "velocity", "goal_velocity", 1000, -1000),
    ("PH54-200-S500-R", {"mode": 0}, "current", "goal_current", 3000, -3000),
    ("PH54-200-S500-R", {"mode": 16}, "pwm", "goal_pwm", 500, -500),
    ("H54-200-S500-R", {"mode": 1}, "velocity", "goal_velocity", 9000, -9000),
    ("H54-200-S500-R", {"mode": 0}, "torque", "goal_torque", 300, -300),
    ("YM070-210-R099-RH", {"mode": 1}, "velocity", "goal_velocity", 1000, -1000),
]


def place_of(unit: Any) -> float:
    """The position of the horn, in counts."""
    return float(unit.motor.position if isinstance(unit, XSeries) else unit.position)


def rig_of(make_rig: MakeRig, text: str) -> Rig:
    return make_rig(Bioloid(units=make_servos(text), baud=BAUD))


def start(rig: Rig) -> Cycle:
    bus = rig.bus("auto")
    return Cycle(bus, scan(bus).devices, 0.01)


def run(rig: Rig, cycle: Cycle, seconds: float) -> None:
    """Tick the cycle for a time."""
    for _ in range(round(seconds * 100)):
        cycle.tick(rig.clock.now())
        rig.clock.sleep_until(rig.clock.now() + 0.01)
    rig.kit.tick(rig.clock.now())


@pytest.mark.parametrize("model", UNITS)
def test_every_model_is_found_with_its_name_and_its_set_up(make_rig: MakeRig, model: str) -> None:
    rig = rig_of(make_rig, f"{model}:7")
    (device,) = scan(rig.bus("auto")).devices
    assert device.name == _SAME.get(model, model)
    assert device.is_complete
    assert (device.mode is None) == (model == "AX-S1")


@pytest.mark.parametrize("model", JOINTS)
def test_a_joint_goes_to_its_goal_and_a_stop_holds_it_on_the_way(make_rig: MakeRig, model: str) -> None:
    rig = rig_of(make_rig, f"{model}:7")
    unit = rig.kit[7]
    cycle = start(rig)
    member = cycle.members[7]
    counts = 60_000 if place_of(unit) == 0 else 400
    begin = place_of(unit)
    cycle.watch(7, ["present_position"], 0.0, rig.clock.now())
    cycle.set_target(7, "torque_enable", 1)
    run(rig, cycle, 0.05)
    slow = {"moving_speed": 15, "profile_velocity": 20}
    for item, raw in slow.items():
        if item in member.table.items:
            cycle.set_target(7, item, raw)
    if "goal_torque" in member.table.items and member.device.protocol == 2:
        cycle.set_target(7, "goal_velocity", 1000)  # PRO: the limit of the speed
    cycle.set_target(7, "goal_position", round(begin) + counts)
    run(rig, cycle, 0.3)
    safe_stop(cycle)
    held = place_of(unit)
    assert begin + counts / 500 < held < begin + counts - 5
    run(rig, cycle, 1.0)
    assert place_of(unit) == pytest.approx(held, abs=max(counts / 40, 3))
    assert unit.registers.get("torque_enable") == 1


@pytest.mark.parametrize(
    ("model", "register", "value", "mode"),
    [
        ("XM430-W350", "operating_mode", 4, "extended position"),
        ("XM430-W350", "operating_mode", 5, "current-based position"),
        ("XL430-W250", "operating_mode", 4, "extended position"),
        ("MX-64(2.0)", "operating_mode", 5, "current-based position"),
        ("PH54-200-S500-R", "mode", 4, "extended position"),
        ("H54-200-S500-R", "mode", 4, "extended position"),
    ],
)
def test_a_stop_holds_beyond_the_limits_of_the_position_mode(
    make_rig: MakeRig, model: str, register: str, value: int, mode: str
) -> None:
    rig = rig_of(make_rig, f"{model}:7")
    unit = rig.kit[7]
    unit.registers.put(register, value)
    cycle = start(rig)
    found = cycle.members[7].device.mode
    assert found is not None and (found.name, found.limits) == (mode, ())
    turn = 4096 if isinstance(unit, XSeries) else 1_100_000
    cycle.set_target(7, "torque_enable", 1)
    run(rig, cycle, 0.05)
    cycle.set_target(7, "goal_position", 5 * turn)
    run(rig, cycle, 2.0)
    if turn == 4096:
        assert place_of(unit) > 4096 + 500
    safe_stop(cycle)
    run(rig, cycle, 0.3)
    held = place_of(unit)
    assert 0 < held < 5 * turn - 100
    run(rig, cycle, 1.0)
    assert place_of(unit) == pytest.approx(held, abs=turn / 1000 + 3)


@pytest.mark.parametrize(("model", "registers", "mode", "effector", "ccw", "cw"), TURNS)
def test_what_turns_stands_after_a_stop(
    make_rig: MakeRig, model: str, registers: dict[str, int], mode: str, effector: str, ccw: int, cw: int
) -> None:
    rig = rig_of(make_rig, f"{model}:7")
    unit = rig.kit[7]
    for name, value in registers.items():
        unit.registers.put(name, value)
    cycle = start(rig)
    found = cycle.members[7].device.mode
    assert found is not None and (found.name, found.effector, found.motion) == (mode, effector, ShaftMotion.RATE)
    cycle.set_target(7, "torque_enable", 1)
    run(rig, cycle, 0.05)
    for raw, sign in ((ccw, 1), (cw, -1)):
        begin = place_of(unit)
        cycle.set_target(7, effector, raw)
        run(rig, cycle, 0.3)
        assert (place_of(unit) - begin) * sign > 50
        safe_stop(cycle)
        run(rig, cycle, 0.2)
        held = place_of(unit)
        run(rig, cycle, 1.0)
        assert place_of(unit) == pytest.approx(held, abs=1.0)


@pytest.mark.parametrize(("model", "registers", "mode", "effector", "ccw", "cw"), TURNS)
def test_a_new_driver_stops_what_turns(
    make_rig: MakeRig, model: str, registers: dict[str, int], mode: str, effector: str, ccw: int, cw: int
) -> None:
    rig = rig_of(make_rig, f"{model}:7")
    unit = rig.kit[7]
    for name, value in registers.items():
        unit.registers.put(name, value)
    first = start(rig)
    first.set_target(7, "torque_enable", 1)
    run(rig, first, 0.02)
    first.set_target(7, effector, cw)
    run(rig, first, 0.1)
    assert stop_what_moves(start(rig)) == (7,)
    rig.clock.sleep_until(rig.clock.now() + 0.2)
    rig.kit.tick(rig.clock.now())
    held = place_of(unit)
    rig.clock.sleep_until(rig.clock.now() + 1.0)
    rig.kit.tick(rig.clock.now())
    assert place_of(unit) == pytest.approx(held, abs=1.0)


@pytest.mark.parametrize("model", ["RX-28", "MX-28"])
def test_a_wheel_that_was_told_to_stand_clockwise_does_not_move(make_rig: MakeRig, model: str) -> None:
    rig = rig_of(make_rig, f"{model}:7")
    for name, value in {"low_limit": 0, "high_limit": 0, "torque_enable": 1, "speed": 1024}.items():
        rig.kit[7].registers.put(name, value)
    assert stop_what_moves(start(rig)) == ()


@pytest.mark.parametrize("model", ["PH54-200-S500-R", "YM070-210-R099-RH"])
def test_the_bus_watchdog_stops_a_large_servo_that_nobody_speaks_to(make_rig: MakeRig, model: str) -> None:
    rig = rig_of(make_rig, f"{model}:7")
    unit = rig.kit[7]
    unit.registers.put("mode", 1)
    cycle = start(rig)
    cycle.set_target(7, "torque_enable", 1)
    run(rig, cycle, 0.02)
    cycle.set_target(7, "goal_velocity", 500)
    run(rig, cycle, 1.5)
    begin = place_of(unit)
    assert begin > 0
    rig.clock.sleep_until(rig.clock.now() + 5.0)
    rig.kit.tick(rig.clock.now())
    assert isinstance(unit, Shaft)
    assert 0 < place_of(unit) - begin <= 0.55 * 500 * unit.count_speed
    assert unit.speed == 0.0


def test_the_multi_turn_mode_of_an_mx_holds_beyond_one_turn(make_rig: MakeRig) -> None:
    rig = rig_of(make_rig, "MX-28:7")
    unit = rig.kit[7]
    unit.registers.put("low_limit", 4095)
    assert isinstance(unit, Servo1)
    cycle = start(rig)
    cycle.set_target(7, "torque_enable", 1)
    cycle.set_target(7, "goal_position", -20_000)
    run(rig, cycle, 3.0)
    assert place_of(unit) < -4096
    safe_stop(cycle)
    held = place_of(unit)
    run(rig, cycle, 0.5)
    assert place_of(unit) == pytest.approx(held, abs=2)


def test_families_share_a_bus(make_rig: MakeRig) -> None:
    rig = rig_of(make_rig, "AX-12:1,MX-28:2,RX-64:3,XL-320:4,XL330-M288:5,XM540-W270:6,PH54-200-S500-R:7,H54-200:8")
    cycle = start(rig)
    now = rig.clock.now()
    for number in cycle.members:
        cycle.watch(number, ["present_position", "present_voltage"], 0.0, now)
    values = cycle.tick(now).values
    assert sorted(values) == [1, 2, 3, 4, 5, 6, 7, 8]
    assert [values[number]["present_voltage"] for number in sorted(values)] == [120, 120, 148, 74, 50, 120, 240, 240]
    assert [values[number]["present_position"] for number in sorted(values)] == [512, 2048, 512, 512, 2048, 2048, 0, 0]


def test_refusals_of_the_large_servos(make_rig: MakeRig) -> None:
    rig = rig_of(make_rig, "PH54-200-S500-R:7")
    driver = driver_of(rig)
    assert answer(driver, "write", 7, "torque_enable", 1) == 1
    assert "access" in str(answer(driver, "write", 7, "operating_mode", 1))
    assert "limit" in str(answer(driver, "write", 7, "goal_position", 501_900))
    assert answer(driver, "write", 7, "torque_enable", 0) == 0
    assert answer(driver, "write", 7, "operating_mode", 1) == 1


def driver_of(rig: Rig) -> ServoDriver:
    """A driver attached to the wire of a rig."""
    driver = ServoDriver()
    driver.configure(Configure())
    driver.attach(rig.link)
    return driver


def answer(driver: ServoDriver, verb: str, device: int, item: str, value: Any = None) -> object:
    """The value of a request, or its error."""
    (reply,) = driver.request(Request(1, verb, device, item, value))
    assert isinstance(reply, Reply)
    return reply.value if reply.ok else reply.error


@pytest.mark.parametrize(
    ("model", "registers", "item", "raw", "signed"),
    [
        ("MX-28", {"low_limit": 0, "high_limit": 0}, "moving_speed", 1024 + 300, -300.0),
        ("MX-28", {}, "moving_speed", 300, 300.0),
        ("MX-64", {"torque_control": 1}, "goal_torque", 1024 + 200, -200.0),
        ("XL-320", {"mode": 1}, "moving_speed", 1024 + 100, -100.0),
        ("PH54-200-S500-R", {"mode": 1}, "goal_velocity", -300, -300.0),
    ],
)
def test_the_driver_knows_directions(
    make_rig: MakeRig, model: str, registers: dict[str, int], item: str, raw: int, signed: float
) -> None:
    rig = rig_of(make_rig, f"{model}:7")
    for name, value in registers.items():
        rig.kit[7].registers.put(name, value)
    driver = driver_of(rig)
    assert driver.signed(7, item, raw) == signed
    assert driver.raw_of(7, item, signed) == raw
    turns = bool(registers)
    assert driver.moves(7, item, raw) == turns


def test_a_single_write_that_makes_a_wheel_is_a_motion(make_rig: MakeRig) -> None:
    rig = rig_of(make_rig, "MX-64:7,XL-320:8")
    driver = driver_of(rig)

    def moves(device: int, item: str, value: int) -> bool:
        return driver.request_moves(Request(1, "write", device, item, value))

    assert moves(7, "torque_control", 1)
    assert not moves(7, "torque_control", 0)
    assert moves(7, "ccw_angle_limit", 0)  # the other limit is 0
    assert not moves(7, "ccw_angle_limit", 3000)
    assert not moves(7, "cw_angle_limit", 0)
    assert "write it with a Request" in str(driver.targets(Targets({(7, "torque_control"): 1})))
    assert not moves(8, "control_mode", 1)  # it refuses that while its torque is on


def test_an_unknown_model_is_served_by_place_and_never_moved(make_rig: MakeRig) -> None:
    rig = rig_of(make_rig, "MX-28:7,XL-320:8")
    rig.kit[7].registers.put("model", 4711)
    rig.kit[8].registers.put("model", 4712)
    driver = ServoDriver()
    driver.configure(Configure())
    (found,) = [message for message in driver.attach(rig.link) if isinstance(message, Found)]
    known = [(info.name, info.family) for info in found.devices]
    assert known == [("unknown model 4711", ""), ("unknown model 4712", "")]
    assert answer(driver, "read", 7, "id") == 7
    assert answer(driver, "read", 7, "@36:2") == 2048
    assert answer(driver, "write", 7, "@25:1", 1) == 1
    assert rig.kit[7].registers.get("led") == 1
    assert "can only be read" in str(answer(driver, "write", 7, "id", 9))
    assert "has no item 'goal_position'" in str(answer(driver, "write", 7, "goal_position", 9))
    assert "is no register" in str(answer(driver, "read", 7, "@36:3"))
    assert "is no register" in str(answer(driver, "read", 7, "@255:2"))
    # What stands behind a place is not known, so that a stop refuses it as it refuses motions.
    assert driver.moves(7, "@30:2", 100)
    rig.sent()
    driver.safe_stop()
    assert driver.stop_what_moves() == ()
    assert rig.sent() == []
    assert driver.targets(Targets({(7, "torque_enable"): 1})) != []


def test_a_known_register_has_no_second_way_by_place(make_rig: MakeRig) -> None:
    driver = driver_of(rig_of(make_rig, "MX-28:7"))
    assert "@30:2 of MX-28 is goal_position: use that name" in str(answer(driver, "write", 7, "@30:2", 9))
    assert "is present_speed" in str(answer(driver, "read", 7, "@39:1"))
    assert answer(driver, "read", 7, "@23:1") == 0
    assert driver.watch(Watch(7, ("@23:1",), 0.1), 0.0) == []


def test_a_device_that_has_not_told_its_model_has_no_table() -> None:
    silent = ServoDevice(5, 0, 0, 1)
    assert silent.table is None
    assert ServoDevice(5, 4711, 0, 2).table is tables.generic_table(2)


def test_the_fast_speeds_of_the_large_servos(make_rig: MakeRig) -> None:
    unit = make_servos("PH54:7")[0]
    assert isinstance(unit, Servo2)
    unit.set_baud(10_500_000)
    assert unit.registers.get("baud") == 9
