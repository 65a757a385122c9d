"""What the safe stop puts on the wire."""

from __future__ import annotations

import pytest

from urbihw.buses.servos.cycle import Cycle
from urbihw.buses.servos.scan import scan
from urbihw.buses.servos.stop import safe_stop, stop_what_moves

from .conftest import Rig, both_back_ends


def start(rig: Rig, protocol: int = 1) -> Cycle:
    bus = rig.bus(2 if protocol == 2 else 1)
    cycle = Cycle(bus, scan(bus).devices, 0.01)
    rig.sent()
    return cycle


@both_back_ends
def test_only_joints_that_we_moved_hold_where_they_are(rig: Rig) -> None:
    cycle = start(rig)
    cycle.set_target(6, "goal_position", 900)
    cycle.tick(rig.clock.now())
    rig.clock.sleep_until(rig.clock.now() + 0.2)
    rig.sent()
    safe_stop(cycle)
    torque, read, *writes = rig.sent()
    place = rig.kit.servo(6).registers.get("present_position")
    assert 512 < place < 900
    assert torque == "FF FF 06 04 02 18 01 DA"
    assert read == "FF FF 06 04 02 24 02 CD"
    assert len(writes) == 2
    assert writes[0] == writes[1]
    assert writes[0].startswith(f"FF FF FE 07 83 1E 02 06 {place & 255:02X} {place >> 8:02X}")
    rig.clock.sleep_until(rig.clock.now() + 1.0)
    rig.kit.tick(rig.clock.now())
    assert rig.kit.servo(6).registers.get("present_position") == pytest.approx(place, abs=2)
    assert rig.kit.servo(6).registers.get("torque_enable") == 1


@both_back_ends
def test_stopping_twice_and_stopping_an_untouched_robot_write_nothing(rig: Rig) -> None:
    cycle = start(rig)
    rig.sent()
    safe_stop(cycle)
    assert rig.sent() == []
    cycle.set_target(6, "goal_position", 900)
    cycle.tick(rig.clock.now())
    safe_stop(cycle)
    rig.sent()
    safe_stop(cycle)
    assert rig.sent() == []


@both_back_ends
def test_wheels_get_speed_0_first(rig: Rig) -> None:
    for item in ("cw_limit", "ccw_limit"):
        rig.kit.servo(3).registers.put(item, 0)
    cycle = start(rig)
    cycle.set_target(3, "moving_speed", 1500)
    cycle.set_target(6, "goal_position", 900)
    cycle.tick(rig.clock.now())
    rig.sent()
    safe_stop(cycle)
    assert rig.sent()[:3] == ["FF FF FE 07 83 20 02 03 00 00 52"] * 2 + ["FF FF 06 04 02 18 01 DA"]


@both_back_ends
def test_the_speed_of_a_joint_is_no_motion(rig: Rig) -> None:
    cycle = start(rig)
    cycle.set_target(6, "moving_speed", 100)
    cycle.tick(rig.clock.now())
    rig.sent()
    safe_stop(cycle)
    assert rig.sent() == []


@both_back_ends
def test_torque_off_only_when_asked(rig: Rig) -> None:
    cycle = start(rig)
    cycle.set_target(6, "goal_position", 900)
    cycle.tick(rig.clock.now())
    safe_stop(cycle, torque_off=True)
    assert rig.kit.servo(6).registers.get("torque_enable") == 0
    assert rig.sent()[-1].startswith("FF FF FE 28 83 18 01 01 00 02 00")


@both_back_ends
def test_a_silent_joint_does_not_keep_the_others_from_stopping(rig: Rig) -> None:
    cycle = start(rig)
    for number in (5, 6):
        cycle.set_target(number, "goal_position", 900)
    cycle.tick(rig.clock.now())
    rig.kit.faults.start("silence", 5)
    safe_stop(cycle)
    assert rig.sent()[-1].startswith("FF FF FE 07 83 1E 02 06")


@both_back_ends
@pytest.mark.parametrize(
    ("mode", "item", "zero"),
    [(1, "goal_velocity", "68 00 04 00 02 00 00 00 00"), (16, "goal_pwm", "64 00 02 00 02 00 00")],
)
def test_turning_x_servos_get_0(x_rig: Rig, mode: int, item: str, zero: str) -> None:
    bus = x_rig.bus(2)
    bus.write(2, 11, bytes((mode,)))
    cycle = Cycle(bus, scan(bus).devices, 0.01)
    cycle.set_target(2, item, 100)
    cycle.tick(x_rig.clock.now())
    x_rig.sent()
    safe_stop(cycle)
    first, second = x_rig.sent()
    assert first == second
    assert zero in first


@both_back_ends
def test_joints_whose_position_was_read_a_moment_ago_are_held_without_a_question(rig: Rig) -> None:
    cycle = start(rig)
    cycle.watch(6, ("present_position",), 0.0, rig.clock.now())
    cycle.set_target(6, "goal_position", 900)
    for _ in range(20):
        cycle.tick(rig.clock.now())
        rig.clock.sleep_until(rig.clock.now() + 0.01)
    place = cycle.members[6].place
    assert place is not None and 512 < place < 900
    rig.sent()
    safe_stop(cycle)
    first, second = rig.sent()
    assert first == second
    assert first.startswith(f"FF FF FE 07 83 1E 02 06 {place & 255:02X} {place >> 8:02X}")


@both_back_ends
def test_a_limp_joint_stays_limp(rig: Rig) -> None:
    cycle = start(rig)
    cycle.set_target(6, "goal_position", 900)
    cycle.tick(rig.clock.now())
    rig.kit.servo(6).registers.put("torque_enable", 0)
    safe_stop(cycle)
    assert rig.kit.servo(6).registers.get("torque_enable") == 0


@both_back_ends
def test_only_some_are_stopped(rig: Rig) -> None:
    cycle = start(rig)
    for number in (5, 6):
        cycle.set_target(number, "goal_position", 900)
    cycle.tick(rig.clock.now())
    safe_stop(cycle, devices=(6,))
    for _ in range(300):
        rig.clock.sleep_until(rig.clock.now() + 0.01)
        rig.kit.tick(rig.clock.now())
    assert rig.kit.servo(5).position == pytest.approx(900, abs=4)
    assert rig.kit.servo(6).position < 600


@both_back_ends
def test_what_somebody_else_has_set_in_motion_is_stopped(rig: Rig) -> None:
    for item in ("cw_limit", "ccw_limit"):
        rig.kit.servo(3).registers.put(item, 0)
    rig.kit.servo(3).registers.put("moving_speed", 500)
    rig.kit.servo(6).registers.put("torque_enable", 1)
    rig.kit.servo(6).registers.put("goal_position", 900)
    rig.clock.sleep_until(rig.clock.now() + 0.2)
    rig.kit.tick(rig.clock.now())
    cycle = start(rig)
    assert stop_what_moves(cycle) == (3, 6)
    place = rig.kit.servo(6).registers.get("present_position")
    rig.clock.sleep_until(rig.clock.now() + 1.0)
    rig.kit.tick(rig.clock.now())
    assert rig.kit.servo(3).registers.get("moving_speed") == 0
    assert rig.kit.servo(6).registers.get("present_position") == pytest.approx(place, abs=3)
    assert stop_what_moves(cycle) == ()


@both_back_ends
def test_a_wheel_that_does_not_say_whether_it_turns_is_told_to_stand(rig: Rig) -> None:
    for item in ("cw_limit", "ccw_limit"):
        rig.kit.servo(3).registers.put(item, 0)
    rig.kit.servo(3).registers.put("moving_speed", 500)
    cycle = start(rig)
    rig.kit.faults.start("silence", 3)
    assert stop_what_moves(cycle) == ()
    assert rig.kit.servo(3).registers.get("moving_speed") == 0


@both_back_ends
def test_a_position_of_a_while_ago_is_no_place_to_hold(rig: Rig) -> None:
    cycle = start(rig)
    cycle.watch(6, ("present_position",), 0.0, rig.clock.now())
    cycle.set_target(6, "goal_position", 900)
    for _ in range(20):
        cycle.tick(rig.clock.now())
        rig.clock.sleep_until(rig.clock.now() + 0.01)
    # Nothing was read since, and the joint has moved on.
    rig.clock.sleep_until(rig.clock.now() + 0.1)
    rig.kit.tick(rig.clock.now())
    reached, read = rig.kit.servo(6).position, cycle.members[6].place
    assert read is not None and read + 20 < reached < 880
    safe_stop(cycle)
    rig.clock.sleep_until(rig.clock.now() + 1.0)
    rig.kit.tick(rig.clock.now())
    assert reached - 1 <= rig.kit.servo(6).position < 890
