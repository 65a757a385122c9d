"""AX-12: motion, compliance, alarms; the test moves the time."""

from __future__ import annotations

import pytest
from fake_talk import Talk

from urbihw_fakes.dynamixel.ax12 import FULL_SPEED, POSITIONS_PER_TURN, SPEED_STEP, Ax12
from urbihw_fakes.dynamixel.bus import ServoBus


@pytest.fixture
def servo() -> Ax12:
    return Ax12(1)


@pytest.fixture
def wire(servo: Ax12) -> Talk:
    return Talk(ServoBus([servo]))


def _seen(wire: Talk, name: str) -> int:
    servo = wire.device[1]  # type: ignore[index]
    row = servo.registers.by_name[name]
    data = bytes.fromhex(wire.p1(1, f"02 {row.address:02X} {row.size:02X}"))
    return int.from_bytes(data[1:], "little")


def test_a_goal_turns_the_torque_on_and_is_reached(wire: Talk) -> None:
    assert wire.p1(1, "03 1E BC 02") == "00"
    assert _seen(wire, "torque_enable") == 1
    assert _seen(wire, "moving") == 1
    wire.now = 0.1
    assert 512 < _seen(wire, "present_position") < 700
    assert _seen(wire, "present_speed") & 1024 == 0
    wire.now = 1.0
    assert abs(_seen(wire, "present_position") - 700) <= 2
    assert _seen(wire, "moving") == 0
    assert _seen(wire, "present_load") == 0


def test_full_speed_is_59_rpm_at_12_volts(wire: Talk) -> None:
    wire.p1(1, "03 1E 00 00")
    wire.now = 0.1
    first = _seen(wire, "present_position")
    wire.now = 0.2
    # 59 rpm are 354 degrees, or 1207 positions, a second; friction takes 2 %.
    assert first - _seen(wire, "present_position") == pytest.approx(0.1 * FULL_SPEED, rel=0.03)


def test_half_the_voltage_is_half_the_speed(servo: Ax12, wire: Talk) -> None:
    servo.volts = 6.0
    wire.p1(1, "03 1E 00 00")
    wire.now = 0.1
    first = _seen(wire, "present_position")
    wire.now = 0.2
    assert first - _seen(wire, "present_position") == pytest.approx(0.05 * FULL_SPEED, rel=0.03)


def test_moving_speed_is_kept(wire: Talk) -> None:
    # Speed 100: 66.6 degrees, or 227 positions, a second.
    wire.p1(1, "03 1E 00 00 64 00")
    wire.now = 0.5
    first = _seen(wire, "present_position")
    wire.now = 1.5
    assert first - _seen(wire, "present_position") == pytest.approx(100 * SPEED_STEP, abs=2)
    # Bit 10: clockwise.
    assert _seen(wire, "present_speed") == pytest.approx(1024 + 100, abs=1)


def test_looking_often_does_not_change_where_it_goes() -> None:
    positions = []
    for looks in (1, 7, 100):
        wire = Talk(ServoBus([Ax12(1)]))
        wire.p1(1, "03 1E 00 03 C8 00")
        for look in range(1, looks + 1):
            wire.now = 0.4 * look / looks
            position = _seen(wire, "present_position")
        positions.append(position)
    assert max(positions) - min(positions) <= 1


def test_time_does_not_go_back(wire: Talk) -> None:
    wire.p1(1, "03 1E 00 03")
    wire.now = 1.0
    there = _seen(wire, "present_position")
    wire.now = 0.5
    assert _seen(wire, "present_position") == there


def test_a_load_bends_it_by_the_compliance_slope(servo: Ax12, wire: Talk) -> None:
    sags = []
    for slope in (32, 64):
        wire.p1(1, f"03 1C {slope:02X} {slope:02X}")
        wire.p1(1, "03 1E 00 02")
        servo.load = -0.4
        wire.now += 0.9
        sags.append(512 - _seen(wire, "present_position"))
        # It holds against a push clockwise by driving counter-clockwise.
        load = _seen(wire, "present_load")
        assert load == pytest.approx(0.4 * 1023, abs=25)
        servo.load = 0.0
        wire.now += 0.9
    assert 8 < sags[0] < 16
    assert sags[1] == pytest.approx(2 * sags[0], abs=4)


def test_inside_the_margin_nothing_drives(servo: Ax12, wire: Talk) -> None:
    wire.p1(1, "03 1A 14 14")
    wire.p1(1, "03 1E 10 02")
    wire.now = 1.0
    assert _seen(wire, "present_position") == 512
    assert _seen(wire, "present_load") == 0
    assert _seen(wire, "moving") == 0


def test_limp_without_torque(servo: Ax12, wire: Talk) -> None:
    wire.p1(1, "03 18 00")
    servo.load = 0.1
    wire.now = 0.2
    assert _seen(wire, "present_position") > 520
    assert _seen(wire, "present_load") == 0


def test_the_ends_of_the_range_hold_a_joint(servo: Ax12, wire: Talk) -> None:
    servo.load = 0.5
    wire.now = 10.0
    assert _seen(wire, "present_position") == 1023


def test_angle_limits(wire: Talk) -> None:
    wire.p1(1, "03 06 90 01 58 02")
    assert wire.p1(1, "03 1E F4 01") == "00"
    # 300 lies outside 400..600: refused with the angle limit error.
    assert wire.p1(1, "03 1E 2C 01") == "02"
    assert _seen(wire, "goal_position") == 500
    # The goal lies outside the new limits until a valid one is written.
    assert wire.p1(1, "03 06 26 02 58 02") == "02"
    assert wire.p1(1, "01") == "02"
    assert wire.p1(1, "03 1E 30 02") == "00"
    assert wire.p1(1, "01") == "00"


def test_wheel_mode_turns_with_the_direction_bit(servo: Ax12, wire: Talk) -> None:
    wire.p1(1, "03 06 00 00 00 00")
    wire.p1(1, "03 18 01")
    assert wire.p1(1, "03 20 F4 01") == "00"
    wire.now = 0.2
    wire.p1(1, "01")
    before = servo.position
    wire.now = 0.4
    # 500 of 1000 counter-clockwise; friction takes 2 % of full speed.
    assert _seen(wire, "present_speed") == pytest.approx(480, abs=3)
    assert (servo.position - before) % POSITIONS_PER_TURN == pytest.approx(0.2 * 0.48 * FULL_SPEED, rel=0.02)
    assert wire.p1(1, "03 20 F4 05") == "00"
    wire.now = 0.6
    assert _seen(wire, "present_speed") == pytest.approx(1024 + 480, abs=3)
    assert _seen(wire, "present_load") == pytest.approx(1024 + 512, abs=3)
    assert _seen(wire, "moving") == 0
    # Both 0 and 1024 mean stop.
    wire.p1(1, "03 20 00 04")
    wire.now = 0.8
    assert _seen(wire, "present_speed") == 0


def test_a_wheel_turns_for_hours_at_once(servo: Ax12, wire: Talk) -> None:
    wire.p1(1, "03 06 00 00 00 00")
    wire.p1(1, "03 18 01")
    wire.p1(1, "03 20 64 00")
    wire.now = 36_000.0
    assert _seen(wire, "present_speed") == pytest.approx(80, abs=2)
    assert 0 <= servo.position < POSITIONS_PER_TURN


def test_max_torque_is_the_limit_from_power_on(servo: Ax12, wire: Talk) -> None:
    wire.p1(1, "03 0E 2C 01")
    assert _seen(wire, "torque_limit") == 1023
    servo.power_off(0.0)
    assert wire.p1(1, "01") == ""
    servo.power_on(0.0)
    assert _seen(wire, "torque_limit") == 300
    assert _seen(wire, "max_torque") == 300


def test_overload_shuts_down_until_the_torque_limit_is_written(servo: Ax12, wire: Talk) -> None:
    wire.p1(1, "03 1E 58 02")
    servo.load = -1.5
    wire.now = 0.5
    assert wire.p1(1, "01") == "00"
    wire.now = 1.3
    assert wire.p1(1, "01") == "20"
    assert _seen(wire, "torque_limit") == 0
    assert servo.alarm
    servo.load = 0.0
    wire.now = 3.0
    # Torque Enable alone does not bring it back.
    assert wire.p1(1, "03 18 01") == "20"
    wire.now = 3.5
    assert _seen(wire, "present_load") == 0
    assert wire.p1(1, "03 22 FF 03") == "00"
    wire.now = 5.0
    assert abs(_seen(wire, "present_position") - 600) <= 2
    assert not servo.alarm


def test_overload_without_shutdown_lasts_as_long_as_the_load(servo: Ax12, wire: Talk) -> None:
    wire.p1(1, "03 12 04")
    wire.p1(1, "03 1E 58 02")
    servo.load = -1.5
    wire.now = 1.3
    assert wire.p1(1, "01") == "20"
    assert _seen(wire, "torque_limit") == 1023
    servo.load = 0.0
    wire.now = 2.0
    assert wire.p1(1, "01") == "00"


def test_overheating_shuts_down(servo: Ax12, wire: Talk) -> None:
    servo.heat(70.9)
    assert wire.p1(1, "01") == "00"
    servo.heat(80.0)
    wire.now = 0.1
    # The data of the answer are good all the same.
    assert wire.p1(1, "02 2B 01") == "04 50"
    assert _seen(wire, "torque_limit") == 0
    # Writing the limit does not help while it is hot.
    wire.p1(1, "03 22 FF 03")
    wire.now = 0.2
    assert _seen(wire, "torque_limit") == 0
    servo.heat(30.0)
    wire.p1(1, "03 22 FF 03")
    wire.now = 0.3
    assert wire.p1(1, "01") == "00"
    assert _seen(wire, "torque_limit") == 1023


def test_a_full_drive_heats_it_up(servo: Ax12, wire: Talk) -> None:
    wire.p1(1, "03 12 00")
    wire.p1(1, "03 1E 58 02")
    servo.load = -1.5
    wire.now = 300.0
    assert 60 < _seen(wire, "present_temperature") < 75
    servo.load = 0.0
    wire.now = 3000.0
    assert _seen(wire, "present_temperature") == 32


def test_voltage_outside_the_limits_is_told_but_stops_nothing(servo: Ax12, wire: Talk) -> None:
    servo.volts = 5.9
    wire.now = 0.1
    assert wire.p1(1, "02 2A 01") == "01 3B"
    assert _seen(wire, "torque_limit") == 1023
    # Voltage is not in Alarm LED as shipped.
    assert not servo.alarm
    servo.volts = 14.0
    assert wire.p1(1, "01") == "00"


def test_an_answer_error_in_the_shutdown_mask_stops_it(wire: Talk) -> None:
    wire.p1(1, "03 12 2C")
    assert wire.p1(1, "03 19 07") == "08"
    assert _seen(wire, "torque_limit") == 0


def test_power_off_forgets_and_falls_limp(servo: Ax12, wire: Talk) -> None:
    wire.p1(1, "03 05 00")
    wire.p1(1, "03 1E 20 03 64 00")
    wire.p1(1, "04 19 01")
    wire.now = 0.3
    servo.power_off(wire.now)
    servo.power_on(wire.now)
    position = _seen(wire, "present_position")
    assert 512 < position < 800
    assert _seen(wire, "goal_position") == position
    assert (_seen(wire, "torque_enable"), _seen(wire, "moving_speed"), _seen(wire, "registered")) == (0, 0, 0)
    assert _seen(wire, "return_delay") == 0
    assert wire.p1(1, "05") == "40"
