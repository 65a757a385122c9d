"""The bus watchdog of the X series: a servo that turns stops when the bus is silent, judged by the fake's body."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from urbihw.buses import messages as m
from urbihw.buses.messages import FromWorker
from urbihw.buses.servos.cycle import Cycle
from urbihw.buses.servos.member import WATCHDOG, WATCHDOG_CHECK_PERIOD_S
from urbihw.buses.servos.scan import scan
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.xseries import XSeries

from .conftest import BAUD, Rig
from .test_worker import Bench, of

WHEEL = 2
SPEEDS = {"goal_velocity": (1, 100), "goal_pwm": (16, 300)}
ARMING = "FF FF FD 00 FE 09 00 83 62 00 01 00 02 19"
"""SYNC_WRITE of 25 to register 98 of servo 2, without its CRC."""


def servo_of(rig: Rig) -> XSeries:
    """The servo that turns, brought to now."""
    rig.kit.tick(rig.clock.now())
    servo = next(unit for unit in rig.kit if unit.id == WHEEL)
    assert isinstance(servo, XSeries)
    return servo


def turns(rig: Rig) -> bool:
    """Whether its horn really turns."""
    return abs(servo_of(rig).motor.speed) > 1.0


def silence(rig: Rig, seconds: float) -> None:
    """The bus is silent for some time."""
    rig.clock.sleep_until(rig.clock.now() + seconds)


def armed(rig: Rig) -> int:
    """Register 98 of the servo."""
    return servo_of(rig).registers.get(WATCHDOG)


@pytest.fixture
def wheel(x_rig: Rig) -> Rig:
    """A bus on which servo 2 is in velocity mode, with its torque on."""
    servo = servo_of(x_rig)
    servo.registers.put("operating_mode", 1)
    servo.registers.put("torque_enable", 1)
    return x_rig


@pytest.fixture
def bench(wheel: Rig) -> Iterator[Bench]:
    made = start(wheel)
    yield made
    made.close()


def start(rig: Rig) -> Bench:
    """A master on the bus that has found the servos."""
    bench = Bench(rig, m.Configure(dead_man=0, options={"protocol": 2}))
    bench.run(0.6)
    return bench


def go(bench: Bench, seconds: float = 1.0, speed: int = 100, item: str = "goal_velocity") -> list[FromWorker]:
    """Let the servo turn, in the epoch of the moment."""
    epoch = bench.engine._authority.epoch
    bench.tell(m.Targets({(WHEEL, item): speed}, epoch))
    return bench.run(seconds)


def test_it_is_armed_once_in_front_of_the_first_speed(bench: Bench) -> None:
    assert armed(bench.rig) == 0
    bench.rig.sent()
    go(bench, 0.1)
    writes = [line for line in bench.rig.sent() if " 83 " in line]
    assert len(writes) == 1
    assert writes[0].startswith(ARMING)
    assert "83 68 00 04 00 02 64 00 00 00" in writes[0]
    go(bench, 0.1, 120)
    assert not any(ARMING in line for line in bench.rig.sent())
    assert armed(bench.rig) == 25


@pytest.mark.parametrize("item", SPEEDS)
def test_a_servo_that_nobody_speaks_to_stops_and_a_new_master_moves_it_again(x_rig: Rig, item: str) -> None:
    mode, speed = SPEEDS[item]
    servo = servo_of(x_rig)
    servo.registers.put("operating_mode", mode)
    servo.registers.put("torque_enable", 1)
    first = start(x_rig)
    go(first, 1.0, speed, item)
    assert turns(x_rig)
    # Worker, daemon and adapter are dead: not even a stop comes.
    silence(x_rig, 0.3)
    assert turns(x_rig)
    silence(x_rig, 0.3)
    assert not turns(x_rig)
    assert armed(x_rig) == -1
    place = servo.motor.position
    silence(x_rig, 5.0)
    assert servo_of(x_rig).motor.position == pytest.approx(place, abs=1)

    second = start(x_rig)
    assert armed(x_rig) == 0
    second.run(1.0)
    assert servo_of(x_rig).motor.position == pytest.approx(place, abs=1)
    go(second, 1.0, speed, item)
    assert turns(x_rig)
    assert armed(x_rig) == 25
    first.close()
    second.close()


def test_in_current_mode_too(make_rig: Callable[[Bioloid], Rig]) -> None:
    rig = make_rig(Bioloid.x_series(2, model="XM430-W350", baud=BAUD))
    servo = servo_of(rig)
    servo.registers.put("operating_mode", 0)
    servo.registers.put("torque_enable", 1)
    bench = start(rig)
    go(bench, 1.0, 100, "goal_current")
    assert turns(rig)
    silence(rig, 0.6)
    assert not turns(rig)
    assert armed(rig) == -1
    bench.close()


def test_a_servo_that_is_not_read_is_kept_awake_by_few_looks(bench: Bench) -> None:
    go(bench, 0.5)
    bench.rig.sent()
    heard = bench.run(3.0)
    assert turns(bench.rig)
    # There are no watches, so the looks are all there is, and their values go nowhere.
    assert len(bench.rig.sent()) == pytest.approx(3.0 / WATCHDOG_CHECK_PERIOD_S, abs=1)
    assert of(m.Samples, heard) == []


def test_the_cycle_gets_five_packets_a_second_more_and_none_per_tick(bench: Bench) -> None:
    items = ("present_load", "present_velocity", "present_position")
    for number in range(1, 19):
        bench.tell(m.Watch(number, items))
    bench.run(0.5)
    bench.rig.sent()
    bench.run(2.0)
    before = len(bench.rig.sent())
    go(bench, 0.5)
    bench.rig.sent()
    heard = bench.run(2.0)
    assert before == pytest.approx(200, abs=1)
    assert len(bench.rig.sent()) == pytest.approx(before + 2.0 / WATCHDOG_CHECK_PERIOD_S, abs=2)
    assert {name for sample in of(m.Samples, heard) for name in sample.values[WHEEL]} == set(items)
    assert all(statistics.late == 0 for statistics in of(m.Statistics, heard))
    assert turns(bench.rig)


def test_all_that_are_armed_are_looked_at_in_one_packet(x_rig: Rig) -> None:
    for servo in x_rig.kit:
        servo.registers.put("operating_mode", 1)
        servo.registers.put("torque_enable", 1)
    bench = start(x_rig)
    for number in range(1, 19):
        bench.tell(m.Targets({(number, "goal_velocity"): 50}))
        bench.run(0.03)
    bench.run(0.2)
    x_rig.sent()
    bench.run(1.0)
    looks = x_rig.sent()
    assert len(looks) == pytest.approx(5, abs=1)
    assert all(line.startswith("FF FF FD 00 FE 19 00 82 62 00 01 00 01 02 03") for line in looks)
    bench.close()


def test_a_master_that_slept_too_long_says_so_and_starts_from_a_stop(bench: Bench) -> None:
    go(bench)
    silence(bench.rig, 0.7)
    heard = bench.run(0.5)
    (stopped,) = of(m.Stopped, heard)
    assert stopped.reason == "servo 2 stopped by itself: it got no packet for 0.5 s"
    assert not turns(bench.rig)
    assert armed(bench.rig) == 0
    bench.run(2.0)
    assert not turns(bench.rig)
    go(bench)
    assert turns(bench.rig)
    assert armed(bench.rig) == 25


def test_a_stop_leaves_it_armed_and_the_next_speed_finds_it_so(bench: Bench) -> None:
    go(bench)
    bench.tell(m.Stop())
    bench.run(2.0)
    assert not turns(bench.rig)
    assert armed(bench.rig) == 25
    go(bench)
    assert turns(bench.rig)


def test_an_arming_that_was_not_heard_is_made_up_for(bench: Bench) -> None:
    go(bench)
    servo_of(bench.rig).registers.put(WATCHDOG, 0)
    bench.run(2 * WATCHDOG_CHECK_PERIOD_S)
    assert armed(bench.rig) == 25
    assert turns(bench.rig)


def test_a_servo_that_was_without_power_is_armed_anew(bench: Bench) -> None:
    go(bench)
    bench.rig.kit.power_off(bench.rig.clock.now(), WHEEL)
    bench.run(1.0)
    bench.rig.kit.power_on(bench.rig.clock.now(), WHEEL)
    bench.run(1.0)
    assert armed(bench.rig) == 0
    servo_of(bench.rig).registers.put("torque_enable", 1)
    go(bench)
    assert turns(bench.rig)
    assert armed(bench.rig) == 25


def test_a_servo_whose_plug_was_out_is_cleared_when_it_is_back(bench: Bench) -> None:
    go(bench)
    bench.rig.kit.faults.start("silence", WHEEL)
    lost = of(m.DeviceState, bench.run(1.0))
    assert lost[-1].new == "lost"
    # Its line is dead both ways: it hears nothing either.
    servo_of(bench.rig).registers.put(WATCHDOG, -1)
    bench.rig.kit.faults.stop()
    heard = bench.run(1.0)
    assert of(m.DeviceState, heard)[0].new == "back"
    assert armed(bench.rig) == 0
    assert not turns(bench.rig)
    go(bench)
    assert turns(bench.rig)


def test_a_goal_that_outlived_the_watchdog_is_taken_back(wheel: Rig) -> None:
    servo = servo_of(wheel)
    # A servo that keeps its goal while it is held, and would go on with it once it is cleared.
    servo.registers.put("goal_velocity", 100)
    servo.registers.put(WATCHDOG, -1)
    servo.registers.put("torque_enable", 0)
    place = servo.motor.position
    bench = start(wheel)
    assert (armed(wheel), servo.registers.get("goal_velocity")) == (0, 0)
    lines = wheel.sent()
    (cleared,) = [index for index, line in enumerate(lines) if line.startswith("FF FF FD 00 02 06 00 03 62 00 00")]
    # With nothing in between, or it would turn meanwhile.
    assert lines[cleared + 1].startswith("FF FF FD 00 02 09 00 03 68 00 00 00 00 00")
    servo.registers.put("torque_enable", 1)
    bench.run(1.0)
    assert servo_of(wheel).motor.position == pytest.approx(place, abs=1)
    bench.close()


def test_a_request_arms_it_too(bench: Bench) -> None:
    bench.tell(m.Request(1, "write", WHEEL, "goal_velocity", 100))
    heard = bench.run(1.0)
    assert of(m.Reply, heard) == [m.Reply(1, True, 100)]
    assert armed(bench.rig) == 25
    assert turns(bench.rig)


def test_joints_and_zeros_arm_nothing(wheel: Rig) -> None:
    cycle = Cycle(wheel.bus(2), scan(wheel.bus(2)).devices, 0.01)
    wheel.sent()
    cycle.set_target(1, "goal_position", 1000)
    cycle.set_target(WHEEL, "goal_velocity", 0)
    cycle.set_target(3, "profile_velocity", 100)
    cycle.tick(wheel.clock.now())
    assert not any("83 62 00" in line for line in wheel.sent())
