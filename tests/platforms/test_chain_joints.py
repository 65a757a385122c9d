"""Joints of a chain: names, frames and groups of ``[devices]``, and the calibration file."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from chain_lab import Lab

from urbihw.kernel.uobject import BadConfig

SERVOS = "AX-12:1,AX-12:2,XL330-M288:3,XL330-M288:4"
STEP = math.tau / 4096


def joints(devices: dict[str, Any], **options: Any) -> Lab:
    """A chain with these ``[devices]``."""
    return Lab.ready(SERVOS, devices=devices, **options)


def test_a_named_joint_is_in_the_tree_in_the_robot_and_in_global() -> None:
    lab = joints({"hip_l": 1, "knee_l": {"id": 3}})
    assert lab.look("hip_l === motor1 && chain.hip_l === motor1 && robot.body.hip_l === motor1") == "true"
    assert lab.look("robot.body.joint[2] === motor2") == "true"
    assert lab.look("robot.body.joint.has(1)") == "false"
    assert lab.look("robot.motors[3] === knee_l") == "true"
    assert lab.look("knee_l.jointName") == '"knee_l"'


def test_groups_are_groups_of_joints() -> None:
    lab = joints({"a": {"id": 1, "groups": ["legs"]}, "b": {"id": 3, "groups": ["legs", "knees"]}})
    lab.say("legs.val = 30deg;", 1.5)
    assert [lab.place(number) for number in (1, 3)] == pytest.approx([math.pi / 6] * 2, abs=0.02)
    assert lab.look("knees.jointName") == 'Group ["b"]'
    assert lab.look("chain.legs === legs") == "true"
    assert (lab.place(2), lab.place(4)) == pytest.approx((0, 0), abs=0.01)


@pytest.mark.parametrize("number", [1, 3])
def test_offset_and_direction_are_those_of_the_body(number: int) -> None:
    lab = joints({"elbow": {"id": number, "offset": 0.2, "direction": -1}})
    assert lab.number("elbow.val") == pytest.approx(0.2, abs=0.01)
    lab.say("elbow.val = 0.7;", 1.5)
    assert lab.place(number) == pytest.approx(-0.5, abs=0.01)
    assert lab.number("elbow.val") == pytest.approx(0.7, abs=0.01)


@pytest.mark.parametrize("number", [1, 3])
def test_a_reversed_wheel_turns_the_other_way(number: int) -> None:
    lab = joints({"wheel_l": {"id": number, "direction": -1}})
    lab.say('wheel_l.mode = "velocity"; wheel_l.speed = 2;', 1)
    assert lab.pace(number) == pytest.approx(-2, abs=0.1)
    assert lab.number("wheel_l.speed") == pytest.approx(2, abs=0.2)


def test_a_reversed_drive_by_current_turns_the_other_way() -> None:
    lab = joints({"arm": {"id": 3, "direction": -1}})
    lab.say('arm.mode = "current"; arm.goalCurrent = 0.3;', 0.5)
    assert lab.pace(3) < -1
    assert lab.number("arm.goalCurrent") == pytest.approx(0.3, abs=0.01)
    assert lab.number("arm.speed") > 1


@pytest.mark.parametrize("number", [1, 3])
def test_limits_of_a_reversed_joint(number: int) -> None:
    lab = joints({"elbow": {"id": number, "offset": 0.2, "direction": -1, "limits": [-0.3, 0.6]}})
    assert lab.number("elbow.val->rangemin") == pytest.approx(-0.3)
    assert lab.number("elbow.val->rangemax") == pytest.approx(0.6)
    lab.say("elbow.val = 2;", 1.5)
    assert lab.place(number) == pytest.approx(-0.4, abs=0.01)
    lab.say("elbow.val = -2;", 1.5)
    assert lab.place(number) == pytest.approx(0.5, abs=0.01)
    item = "goal_position"
    lab.say(f'elbow.writeRegister("{item}", 10);', 1.5)
    assert abs(lab.place(number)) <= 0.51, "the worker enforces them, too"


@pytest.mark.parametrize("name", ["elbow", "motor3"])
def test_limits_are_given_by_either_name_of_a_joint(name: str) -> None:
    lab = joints({"elbow": {"id": 3}}, limits={name: {"position": [-0.3, 0.4]}})
    lab.say("elbow.val = 1;", 1.5)
    assert lab.place(3) == pytest.approx(0.4, abs=0.01)
    assert lab.look("elbow.limitedBy") == f'"limits.{name}.position"'


def test_cw_and_ccw_limits_of_a_reversed_joint_are_those_of_the_joint() -> None:
    lab = joints({"elbow": {"id": 1, "direction": -1, "offset": 0.1}})
    lab.say("elbow.cwLimit = -0.5; elbow.ccwLimit = 1;", 0.5)
    assert lab.number("elbow.cwLimit") == pytest.approx(-0.5, abs=0.01)
    assert lab.number("elbow.ccwLimit") == pytest.approx(1, abs=0.01)
    lab.say("elbow.val = 2;", 1.5)
    assert lab.place(1) == pytest.approx(-0.9, abs=0.02)


def test_the_narrower_of_two_position_limits_holds() -> None:
    lab = joints({"elbow": {"id": 3, "limits": [-0.5, 0.5]}}, limits={"motor3": {"position": [-1.0, 0.3]}})
    lab.say("elbow.val = 0.45;", 1.5)
    assert lab.place(3) == pytest.approx(0.3, abs=0.01)
    lab.say("elbow.val = -0.9;", 1.5)
    assert lab.place(3) == pytest.approx(-0.5, abs=0.01)


def calibrated(tmp_path: Path, row: dict[str, int], devices: dict[str, Any] | None = None) -> Lab:
    """A chain with a calibration file of one joint."""
    file = tmp_path / "arm.json"
    file.write_text(json.dumps({"elbow": {"id": 3, "drive_mode": 0, "homing_offset": 0, **row}}))
    return Lab.ready(SERVOS, calibration=str(file), devices=devices or {})


def test_the_calibrated_middle_is_zero_and_the_range_is_the_limit(tmp_path: Path) -> None:
    lab = calibrated(tmp_path, {"range_min": 1800, "range_max": 2600})
    assert lab.look("elbow === motor3") == "true"
    assert lab.number("elbow.val") == pytest.approx((2048 - 2200) * STEP, abs=2 * STEP)
    lab.say("elbow.val = 0;", 1.5)
    assert lab.place(3) == pytest.approx((2200 - 2048) * STEP, abs=0.01)
    lab.say("elbow.val = 3;", 1.5)
    assert lab.place(3) == pytest.approx((2600 - 2048) * STEP, abs=0.01)
    lab.say("elbow.val = -3;", 1.5)
    assert lab.place(3) == pytest.approx((1800 - 2048) * STEP, abs=0.01)


def test_a_reversed_drive_mode_reverses_the_joint(tmp_path: Path) -> None:
    lab = calibrated(tmp_path, {"range_min": 1800, "range_max": 2600, "drive_mode": 1})
    lab.say("elbow.val = 0.1;", 1.5)
    assert lab.place(3) == pytest.approx((2200 - 2048) * STEP - 0.1, abs=0.01)


def test_names_and_limits_of_the_settings_come_before_those_of_the_calibration(tmp_path: Path) -> None:
    row = {"range_min": 1800, "range_max": 2600}
    lab = calibrated(tmp_path, row, {"lower": {"id": 3, "offset": 0.1, "limits": [-0.2, 0.2]}})
    lab.say("lower.val = 1;", 1.5)
    assert lab.place(3) == pytest.approx((2200 - 2048) * STEP + 0.1, abs=0.01)


def test_a_name_of_the_calibration_that_would_hide_a_slot_is_left_out_and_the_others_stay(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = tmp_path / "arm.json"
    row = {"drive_mode": 0, "homing_offset": 0, "range_min": 1800, "range_max": 2600}
    file.write_text(json.dumps({"Global": {"id": 3, **row}, "load": {"id": 1, **row}, "elbow": {"id": 4, **row}}))
    lab = Lab.ready(SERVOS, calibration=str(file), devices={"hip": 1})
    assert lab.look("robot.body.elbow === motor4 && elbow === motor4 && hip === motor1") == "true"
    assert lab.look("robot.body.joint[3] === motor3 && Global.hasSlot(\"echo\")") == "true"
    lines = [record.getMessage() for record in caplog.records if record.levelname != "INFO"]
    assert [line for line in lines if not line.startswith("unexpected")] == [
        "the calibration names motor 3 Global, which is a slot of urbiscript or of the robot; choose another name; "
        "it stays motor3",
    ]


def test_a_name_that_a_program_uses_is_left_to_it_and_the_others_stay(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab(SERVOS, devices={"hip": 1, "elbow": 3})
    lab.say("var Global.hip = 7|;")
    lab.until(lambda: bool(lab.opened))
    lab.run(0.5)
    assert lab.look("hip") == "7"
    assert lab.look("robot.body.elbow === motor3 && elbow === motor3 && robot.body.joint[1] === motor1") == "true"
    lines = [record.getMessage() for record in caplog.records if record.levelname != "INFO"]
    lines = [line for line in lines if not line.startswith("unexpected")]
    assert lines == ["motor 1 is not hip: a program has given that name to something else"]


def test_a_calibration_that_cannot_be_read_is_a_mistake_in_the_settings(tmp_path: Path) -> None:
    with pytest.raises(BadConfig, match=r"options\.calibration: .*none\.json: .*No such file"):
        Lab(SERVOS, calibration=str(tmp_path / "none.json"))


def test_a_bioloid_has_named_joints_too() -> None:
    from bioloid_lab import BAUD
    from bioloid_lab import Lab as Bioloid

    from urbihw_fakes.bioloid import Bioloid as Kit

    lab = Bioloid.ready(Kit(servos=(5, 6), baud=BAUD), devices={"knee_l": {"id": 6, "direction": -1}})
    lab.say("knee_l.val = 30deg;", 1)
    assert lab.register(6, "goal_position") == round((-30 + 150) * 1023 / 300)
    assert lab.look("robot.body.knee_l === motor6") == "true"


# ---------------------------------------------------------------- devices that are no servos


def test_a_device_without_a_motor_has_its_registers() -> None:
    lab = Lab.ready("AX-12:1,AX-S1:100")
    assert lab.say("motors.keys; chain.devices.keys; device100.modelName;") == '[1]\n[100]\n"AX-S1"'
    assert lab.say('device100.readRegister("ir_left");', 0.1) == "0"


def test_a_servo_of_an_unknown_model_is_served_by_place_and_left_alone() -> None:
    lab = Lab("AX-12:1,AX-12:2")
    lab.kit[2].registers.put("model", 4711)
    lab.until(lambda: bool(lab.opened))
    lab.run(1)
    assert lab.opened == [None]
    assert lab.say("motors.keys; device2.modelName;") == '[1]\n"unknown model 4711"'
    assert lab.say('device2.readRegister("@30:2");', 0.1) == str(lab.register(2, "goal_position"))
    assert lab.register(2, "torque_enable") == 0
    lab.say('device2.writeRegister("@25:1", 1);', 0.2)
    assert lab.register(2, "led") == 1
    lab.look("chain.estop = true")
    lab.run(0.1)
    assert "emergency stop" in lab.say('device2.writeRegister("@30:2", 600);', 0.3)


def test_a_lost_servo_and_its_return() -> None:
    lab = Lab.ready(SERVOS)
    lab.say("motor3.val = 30deg;", 1)
    lab.kit.power_off(lab.bus_clock.now(), 3)
    lab.run(2)
    assert lab.look("motor3.state") == '"lost"'
    lab.say("motor1.val = 20deg;", 1.5)
    assert lab.place(1) == pytest.approx(math.radians(20), abs=0.02)
    lab.kit.power_on(lab.bus_clock.now(), 3)
    lab.run(3)
    assert lab.look("motor3.state") in ('"back"', '"ok"')
    assert lab.register(3, "torque_enable") == 0
