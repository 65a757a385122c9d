"""What is written to a motor that is switched off: it does not move, and who wrote can see why."""

from __future__ import annotations

import math

import pytest
from bioloid_lab import BAUD
from bioloid_lab import Lab as Bioloid
from cia402_lab import Lab as Drives
from lab import RobotLab
from p3dx_lab import Lab as Pioneer
from segway_lab import Lab as Segway

from urbihw_fakes.bioloid import Bioloid as Kit


def ax() -> Bioloid:
    return Bioloid.ready(Kit(servos=(6, 7), sensors=(), baud=BAUD))


def assert_off(lab: RobotLab, place: str, words: str) -> None:
    assert lab.look(f"{place}.limitedBy") == '"off"'
    assert math.isnan(lab.number(f"{place}.applied"))
    assert words in lab.look(f"{place}.why")


def test_a_joint_that_is_off_says_so_once_to_each_client() -> None:
    lab = ax()
    lab.say("at (motor6.limited?(var by)) echo(by);")
    lab.say("motor6.load = 0|;", 0.2)
    words = "motor 6 is off: switch it on with load = 1"
    heard = lab.say("motor6.val = 0.5|;", 0.1)
    assert f"warning: {words}" in heard and "*** off" in heard
    assert_off(lab, "motor6", words)
    assert lab.number("motor6.requested") == 0.5
    assert "warning" not in lab.say("motor6.val = 0.6|;", 0.1)
    assert words in lab.look("motor6.val = 0.7")


def test_a_trajectory_warns_once_and_moves_when_it_is_switched_on() -> None:
    lab = ax()
    lab.say("motor6.load = 0|;", 0.2)
    assert lab.say("motor6.val = 0 sin:1s ampli:20deg,", 3.0).count("warning") == 1
    assert lab.look("motor6.limitedBy") == '"off"'
    assert "warning" not in lab.say("motor6.load = 1|;", 0.5)
    assert lab.look("motor6.limitedBy") == '""'
    assert lab.say("motor6.load = 0|;", 0.5).count("warning") == 1


@pytest.mark.parametrize("speed", ["motor7.speed = 2|;"])
def test_a_wheel_that_is_off(speed: str) -> None:
    lab = ax()
    lab.say("motor7.cwLimit = motor7.ccwLimit = 0|; sleep(500ms); motor7.load = 0|;", 1.0)
    assert "warning: motor 7 is off" in lab.say(speed, 0.2)
    assert_off(lab, "motor7", "motor 7 is off")


def test_an_alarm_has_taken_the_torque_and_it_is_said_how_to_get_it_back() -> None:
    lab = ax()
    lab.say("motor6.val = 0.1|;", 0.5)
    lab.kit.servo(6).registers.put("torque_limit", 0)
    lab.run(0.5)
    words = "motor 6 gives no torque: its torque limit is 0, as after an alarm: mend the cause, then motor6.load = 1"
    assert words in lab.say("motor6.val = 0.2|;", 0.1)
    assert "warning" not in lab.say("motor6.load = 1| motor6.val = 0.3|;", 0.5)
    assert lab.look("motor6.limitedBy") == '""'


def test_switching_on_is_no_time_for_a_warning() -> None:
    lab = ax()
    lab.say("motor6.load = 0|;", 0.3)
    assert "warning" not in lab.say("motor6.load = 1| motor6.val = 0.3|;", 0.5)
    assert lab.number("motor6.val") == pytest.approx(0.3, abs=0.02)


def test_a_motor_that_was_never_switched_on_is_by_its_first_goal() -> None:
    lab = ax()
    assert "warning" not in lab.say("motor6.val = 0.3|;", 0.5)


def test_an_x_servo_that_is_off() -> None:
    lab = Bioloid.ready(Kit.x_series(2, baud=BAUD))
    lab.say("motor1.load = 0|;", 0.2)
    assert "warning: motor 1 is off: switch it on with load = 1" in lab.say("motor1.val = 0.5|;", 0.1)
    assert_off(lab, "motor1", "motor 1 is off")


def test_where_writing_is_an_error_there_is_no_warning_beside_it() -> None:
    drives = Drives.ready()
    heard = drives.say("drive5.speed = 1;", 0.1)
    assert "drive 5 is off" in heard and "warning" not in heard
    assert_off(drives, "drive5", "switch it on with load = 1")
    pioneer = Pioneer.ready()
    heard = pioneer.say("P3dx.body.x.speed = 0.2;", 0.1)
    assert "the motors are off; switch them on first: P3dx.body.load = 1" in heard and "warning" not in heard
    assert_off(pioneer, "P3dx.body.x", "P3dx.body.load = 1")


def test_a_segway_that_is_disabled() -> None:
    segway = Segway.ready()
    segway.say('rmp.mode = "disabled"|;', 1.0)
    heard = segway.say("rmp.forwardSpeed = 1|;", 0.2)
    assert 'warning: the base does not drive (mode disabled): switch it on with rmp.mode = "tractor"' in heard
    assert_off(segway, "rmp", "mode disabled")


def test_a_base_that_does_not_drive_refuses_speeds_and_does_not_count_them_as_movement() -> None:
    segway = Segway.ready()
    segway.say('rmp.mode = "disabled"|;', 1.0)
    for order in ("robot.xSpeed = 0.2;", "robot.go(1);", "robot.turn(1);"):
        assert "robot: the base does not drive (mode disabled): switch it on" in segway.say(order, 1.0)
        assert segway.look("[robot.xSpeed, robot.yawSpeed, robot.moving]") == "[0, 0, false]"
    assert segway.say("robot.xSpeed = 0;", 0.1) == "0"


def test_a_base_that_was_switched_on_drives() -> None:
    segway = Segway.ready()
    segway.say('rmp.mode = "disabled"|;', 0.1)
    assert segway.say("robot.switchOn;", 0.5) == ""
    before = segway.number('robot.position["x"]')
    assert segway.say("robot.xSpeed = 0.2;", 1.0) == "0.2"
    assert segway.number('robot.position["x"]') > before + 0.05


def test_a_stop_does_not_stiffen_a_joint_that_was_switched_off() -> None:
    lab = ax()
    lab.say("motor6.val = 0.3; sleep(1s); motor6.load = 0;", 2.0)
    assert lab.register(6, "torque_enable") == 0
    lab.say("robot.stop;", 1.0)
    assert lab.register(6, "torque_enable") == 0
