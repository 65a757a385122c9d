"""X-series servos: the same slots on protocol 2.0."""

from __future__ import annotations

import math

import pytest
from bioloid_lab import BAUD, Lab

from urbihw_fakes.bioloid import Bioloid as Kit


def lab_of(model: str) -> Lab:
    return Lab.ready(Kit.x_series(3, model=model, baud=BAUD))


@pytest.fixture
def lab() -> Lab:
    return lab_of("XL430-W250")


def test_they_are_motors(lab: Lab) -> None:
    assert lab.say("motors.keys; motor2.modelName; motor2.wheel;") == '[1, 2, 3]\n"XL430-W250"\nfalse'
    assert {lab.register(number, "torque_enable") for number in (1, 2, 3)} == {0}


def test_val_switches_the_torque_on_and_moves(lab: Lab) -> None:
    lab.say("motor2.val = 90deg time:1s;", 1.5)
    assert lab.register(2, "torque_enable") == 1
    assert lab.number("motor2.val") == pytest.approx(math.pi / 2, abs=0.02)


def test_speed_of_a_joint_is_its_profile(lab: Lab) -> None:
    lab.say("motor2.speed = 1 | motor2.val = 90deg;", 0.5)
    assert lab.register(2, "profile_velocity") == round(1 / 0.0239808)
    assert lab.number("motor2.speed") == pytest.approx(1, abs=0.1)


def test_limits_are_set_while_the_torque_is_off_for_a_moment(lab: Lab) -> None:
    lab.say("motor2.val = 0;", 0.3)
    lab.say("motor2.cwLimit = -1 | motor2.ccwLimit = 1;", 0.3)
    assert lab.register(2, "min_position") == 2048 - round(1 / 0.00153398)
    assert lab.register(2, "torque_enable") == 1
    assert lab.number("motor2.val->rangemax") == pytest.approx(1, abs=0.002)


def test_wheel_mode_and_back(lab: Lab) -> None:
    lab.say("motor2.val = 0;", 0.3)
    lab.say("motor2.cwLimit = motor2.ccwLimit = 0; motor2.speed = -2;", 1)
    assert lab.register(2, "operating_mode") == 1
    assert lab.number("motor2.speed") == pytest.approx(-2, abs=0.1)
    assert lab.look("motor2.wheel") == "true"
    lab.say("motor2.speed = 0;", 0.3)
    lab.say("motor2.cwLimit = -180deg | motor2.ccwLimit = 179deg;", 0.3)
    assert lab.register(2, "operating_mode") == 3
    assert lab.look("motor2.wheel") == "false"


def test_load_switches_off_and_on(lab: Lab) -> None:
    lab.say("motor2.val = 0;", 0.3)
    assert lab.number("motor2.load") == 1
    lab.say("motor2.load = 0;", 0.3)
    assert (lab.register(2, "torque_enable"), lab.number("motor2.load")) == (0, 0)
    lab.say("motor2.val = 1;", 0.3)
    assert lab.register(2, "torque_enable") == 0
    lab.say("motor2.load = 1;", 0.3)
    assert lab.register(2, "torque_enable") == 1
    assert lab.number("motor2.val") == pytest.approx(0, abs=0.02)


def test_what_is_kept_wants_the_motor_off(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    lab.say("motor2.val = 0;", 0.3)
    lab.say("motor2.temperatureLimit = 60;", 0.3)
    assert "switch the motor off first: motor2.load = 0" in caplog.text
    lab.say("motor2.load = 0;", 0.3)
    lab.say("motor2.temperatureLimit = 60;", 0.3)
    assert lab.register(2, "temperature_limit") == 60


def test_a_current_is_shown_as_a_torque() -> None:
    lab = lab_of("XM430-W350")
    lab.say("motor2.val = 0;", 0.3)
    lab.kit.x_servo(2).motor.load = 0.3
    lab.run(0.5)
    assert lab.number("motor2.torque") == pytest.approx(-0.3 * 4.1, abs=0.5)


def test_alarm_and_reboot(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    lab.kit.x_servo(2).heat(90)
    lab.say("motor2.val = 0;", 2)
    assert lab.look("motor2.alarm") == '"overheating"'
    assert "motor 2: overheating" in caplog.text
    lab.kit.x_servo(2).heat(None)
    lab.kit.x_servo(2).heat(30)
    lab.say("motor2.reboot;", 3)
    assert lab.look("motor2.alarm") == '""'
