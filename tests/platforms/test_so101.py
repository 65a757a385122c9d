"""The SO-101 arm: joints by LeRobot's names, calibration, the gripper's limits, a leader that is followed."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from bioloid_lab import Lab as BioloidLab
from so101_lab import STEP, Lab

from urbihw import platforms
from urbihw.buses.messages import Found
from urbihw.buses.servos.calibration import JointCalibration, save
from urbihw.platforms.servos.robot import ServoRobot
from urbihw.platforms.so101 import arm
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.feetech.servo import FeetechServo
from urbihw_fakes.so101 import JOINTS, So101

TELEOPERATION = 'load("teleop.u");'


@pytest.fixture(autouse=True)
def _search_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder of the platform is on the search path, as the daemon has it."""
    monkeypatch.setenv("URBI_PATH", str(Path(platforms.__file__).with_name("so101")))


def _calibration(path: Path, kit: So101) -> str:
    """A file as LeRobot writes it for these arms: 2048 is the middle of each servo, the range that of the stops."""
    joints = {}
    for name, joint in JOINTS.items():
        low, high = (0, 4095) if joint.low is None or joint.high is None else (2048 + joint.low, 2048 + joint.high)
        joints[name] = JointCalibration(joint.id, 0, kit.joint(name).registers.get("offset"), low, high)
    save(path, joints)
    return str(path)


# The joints.


def test_joints_have_the_names_of_lerobot_and_places_in_the_tree() -> None:
    lab = Lab.ready()
    for name, place in {
        "shoulder_pan": "robot.body.arm.shoulder.yaw",
        "shoulder_lift": "robot.body.arm.shoulder.pitch",
        "elbow_flex": "robot.body.arm.elbow",
        "wrist_flex": "robot.body.arm.wrist.pitch",
        "wrist_roll": "robot.body.arm.wrist.roll",
        "gripper": "robot.body.arm.grip",
    }.items():
        assert lab.look(f"so101.{name} === {place} && {name} === {place}") == "true"


def test_joints_have_one_name_and_the_order_of_the_arm_wherever_they_are_listed() -> None:
    kit = So101(calibrated=True)
    late = kit.servo(2)
    kit.remove(late)
    lab = Lab.ready(kit)
    kit.add(late)
    lab.until(lambda: lab.look("motors.size") == "6")
    names = " ".join(JOINTS)
    assert f"*** RotationalMotor: {names}" in lab.say("robot.flatDump;")
    assert lab.look('robot.motionPlayer.names(robot.motionPlayer.joints).join(" ")') == f'"{names}"'
    tree = json.loads(lab.say("echo(System.treeText(robot))|;").removeprefix("*** "))
    assert [part["global"] for part in _leaves(tree["robot"])] == [*JOINTS]
    # Other names go on working.
    for name, other in (("shoulder_pan", "shoulderYaw"), ("elbow_flex", "elbow"), ("gripper", "grip")):
        assert lab.look(f"{other} === {name} && {name} === motor{JOINTS[name].id}") == "true"
        assert lab.look(f'robot.motionPlayer.choose("x", ["{other}", "motor2"])[0][0]') == f'"{name}"'


def test_servos_that_come_one_after_the_other_join_the_tree_in_turn(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = ServoRobot.on_found

    def in_turn(robot: ServoRobot, message: Found) -> None:
        for info in message.devices:
            found(robot, replace(message, devices=(info,)))

    monkeypatch.setattr(ServoRobot, "on_found", in_turn)
    lab = Lab(So101(calibrated=True))
    lab.say("var Global.told = []|; at (so101.found?(var motor)) told << (motor === so101.getSlot(motor.jointName));")
    lab.until(lambda: bool(lab.opened))
    assert lab.opened == [None]
    assert "not complete" not in caplog.text
    assert lab.look("told") == str([True] * 6).lower(), "who is told has a place in the tree"
    assert f"*** RotationalMotor: {' '.join(JOINTS)}" in lab.say("robot.flatDump;")


def _leaves(node: dict[str, Any]) -> list[dict[str, Any]]:
    return [leaf for part in node["parts"] for leaf in _leaves(part)] or [node]


def test_a_name_that_a_program_uses_is_left_to_it() -> None:
    lab = Lab(So101(calibrated=True))
    lab.say("var Global.gripper = 3|;")
    lab.until(lambda: bool(lab.opened))
    assert lab.opened == [None]
    assert lab.look("[gripper, grip === so101.gripper, elbow_flex === elbow]") == "[3, true, true]"


def test_starting_moves_nothing_and_leaves_the_torque_as_it_is() -> None:
    lab = Lab.ready()
    lab.run(1)
    assert [unit.registers.get("torque") for unit in lab.kit] == [0] * 6
    assert [lab.bend(name) for name in JOINTS] == [0] * 6


def test_a_joint_goes_where_it_is_told_in_rad() -> None:
    lab = Lab.ready()
    lab.say("elbow_flex.val = 0.8; shoulder_lift.val = -0.5;", 1.5)
    assert lab.bend("elbow_flex") == pytest.approx(0.8, abs=0.005)
    assert lab.bend("shoulder_lift") == pytest.approx(-0.5, abs=0.005)
    assert lab.number("elbow_flex.val") == pytest.approx(0.8, abs=0.005)


def test_speed_and_acceleration_are_si() -> None:
    lab = Lab.ready()
    lab.say("shoulder_pan.speed = 0.5; shoulder_pan.val = 1;", 1.0)
    assert lab.bend("shoulder_pan") == pytest.approx(0.5, abs=0.05)
    assert lab.number("shoulder_pan.speed") == pytest.approx(0.5, abs=0.02)


def test_the_calibration_of_lerobot_gives_zero_direction_and_range(tmp_path: Path) -> None:
    kit = So101(calibrated=True)
    path = tmp_path / "arm.json"
    save(
        path,
        {
            "shoulder_pan": JointCalibration(1, 0, 0, 1848, 2848),
            "elbow_flex": JointCalibration(3, 1, 0, 1148, 2948),
        },
    )
    lab = Lab.ready(kit, calibration=str(path))
    assert lab.number("shoulder_pan.val") == pytest.approx((2048 - 2348) * STEP, abs=1e-6)
    lab.say("shoulder_pan.val = 0; elbow_flex.val = 0.5;", 1.5)
    assert lab.bend("shoulder_pan") == pytest.approx(300 * STEP, abs=0.005)
    assert lab.bend("elbow_flex") == pytest.approx(-0.5, abs=0.005)
    lab.say("shoulder_pan.val = 3;", 1.5)
    assert lab.bend("shoulder_pan") == pytest.approx(800 * STEP, abs=0.005)


def test_the_modes_of_the_servo_and_their_stop() -> None:
    lab = Lab.ready()
    for mode, go in (("wheel", "wrist_roll.speed = 1;"), ("pwm", "wrist_roll.goalPwm = 0.3;")):
        lab.say(f'wrist_roll.mode = "{mode}";', 0.5)
        lab.say(go, 1.0)
        assert lab.kit.joint("wrist_roll").motor.speed * STEP > 0.9, mode
        lab.say("so101.stop;", 0.3)
        assert lab.kit.joint("wrist_roll").motor.speed == 0
    lab.say('wrist_roll.mode = "position";', 0.5)
    before = lab.bend("wrist_roll")
    lab.run(1)
    assert lab.bend("wrist_roll") == before
    # The mode is kept without power, so the EEPROM was open while it was written and is closed again.
    assert lab.kit.joint("wrist_roll").registers.kept["mode"] == 0
    assert lab.register(5, "lock") == 1


def test_an_alarm_has_words() -> None:
    lab = Lab.ready()
    lab.kit.joint("elbow_flex").volts = 12.0
    lab.run(0.2)
    assert lab.look("elbow_flex.alarm") == '"input voltage"'


# The gripper.


def test_the_gripper_is_guarded_from_the_start_and_for_good() -> None:
    lab = Lab.ready()
    lab.run(1)
    gripper = lab.kit.joint("gripper").registers
    assert [gripper.kept[name] for name in ("max_torque", "protection_current", "overload_torque")] == [500, 250, 25]
    assert gripper.get("torque_limit") == 500
    assert lab.kit.joint("elbow_flex").registers.get("torque_limit") == 1000
    lab.say("gripper.torqueLimit = 1;", 0.3)
    assert gripper.get("torque_limit") == 500


@pytest.mark.parametrize(
    ("devices", "number"),
    [({"pan": 1, "claw": 6}, 6), ({"gripper": 5}, 5), ({}, 6)],
)
def test_the_gripper_is_guarded_whatever_the_settings_call_it(devices: dict[str, Any], number: int) -> None:
    lab = Lab.ready(devices=devices)
    lab.run(1)
    assert [each for each in range(1, 7) if lab.kit[each].registers.get("overload_torque") == 25] == [number]


def test_a_gripper_that_holds_something_does_not_burn() -> None:
    lab = Lab.ready()
    lab.kit.joint("gripper").motor.stops = (2300 - 200, 2300 + 200)
    lab.say("gripper.val = 1;", 1.0)
    servo = lab.kit.joint("gripper")
    assert 0.25 < servo.motor.drive <= 0.5
    lab.run(3)
    assert servo.motor.drive <= 0.2
    assert lab.look("gripper.alarm") == '"overload"'


def test_a_gripper_with_torque_is_guarded_in_its_ram_and_later_in_its_eeprom() -> None:
    kit = So101(calibrated=True)
    kit.joint("gripper").registers.put("torque", 1)
    lab = Lab.ready(kit)
    lab.run(1)
    assert lab.register(6, "torque_limit") == 500
    assert lab.register(6, "torque") == 1
    assert lab.register(6, "protection_current") == 500
    lab.say("gripper.load = 0;", 1.0)
    assert lab.register(6, "protection_current") == 250


# What else may be on the bus.


def test_a_servo_of_another_make_is_left_alone(caplog: pytest.LogCaptureFixture) -> None:
    kit = So101(calibrated=True)
    kit.add(Ax12(9))
    kit.add(FeetechServo("SCS0009", 10))
    lab = Lab.ready(kit)
    assert lab.look("motors.keys") == "[1, 2, 3, 4, 5, 6]"
    assert "has AX-12A (id 9), SCS0009 (id 10), which SO-101 does not have; left alone: use --pla" in caplog.text


def test_a_bioloid_on_the_bus_is_told_in_one_line() -> None:
    lab = Lab(Bioloid(servos=(1, 2), sensors=(100,)))
    lab.until(lambda: bool(lab.opened))
    assert str(lab.opened[0]) == (
        "pipe://robot?baud=1000000 has AX-12A (id 1), AX-12A (id 2), AX-S1 (id 100), which SO-101 does not have; "
        "left alone: use --platform bioloid for a Bioloid, --platform chain for any servos"
    )


def test_an_arm_on_the_bus_of_a_bioloid_is_told_in_one_line() -> None:
    lab = BioloidLab(Bioloid(units=So101()))
    lab.until(lambda: bool(lab.opened))
    told = str(lab.opened[0])
    assert "STS3215 (id 6), which ROBOTIS Bioloid does not have; left alone: use --platform so101 for an SO" in told


# Leader and follower.


def _teleoperation(leader: So101) -> Lab:
    lab = Lab.ready(leader=leader)
    lab.until(lambda: lab.look("leader.link") == "true" and lab.look("leader.motors.size") == "6")
    assert lab.say(TELEOPERATION, 3.0) == ""
    assert lab.look("teleoperation.type") == '"Tag"'
    return lab


def test_the_body_of_the_follower_follows_that_of_the_leader() -> None:
    leader = So101(calibrated=True)
    leader.hold("elbow_flex", 300)
    lab = _teleoperation(leader)
    assert lab.bend("elbow_flex") == pytest.approx(300 * STEP, abs=0.01)
    worst = 0.0
    for tick in range(300):
        swing = 400 * math.sin(math.tau * tick / 200)
        leader.hold("shoulder_pan", swing)
        leader.hold("gripper", swing / 2)
        lab.run(0.01)
        worst = max(worst, abs(lab.bend("shoulder_pan") - swing * STEP))
    # A swing of 35 degrees in two seconds: the follower is less than 60 ms behind.
    assert worst < 400 * STEP * math.pi * 0.06
    lab.run(0.3)
    for name in JOINTS:
        assert lab.bend(name) == pytest.approx(leader.bend(name) * STEP, abs=0.01), name


def test_nothing_moves_the_leader() -> None:
    leader = So101(calibrated=True)
    lab = _teleoperation(leader)
    leader.hold("elbow_flex", 200)
    lab.run(1)
    assert [unit.registers.get("torque") for unit in leader] == [0] * 6
    assert leader.bend("elbow_flex") == 200


def test_no_program_moves_the_leader_unless_it_is_allowed_to() -> None:
    leader = So101(calibrated=True)
    lab = Lab.ready(leader=leader)
    lab.until(lambda: lab.look("leader.motors.size") == "6")
    told = lab.say("leader.shoulder_pan.val = 0.3;", 1.0)
    assert "the leader is moved by hand" in told
    lab.say("leader.motors.load = 1;", 0.5)
    assert leader.bend("shoulder_pan") == 0
    assert [unit.registers.get("torque") for unit in leader] == [0] * 6
    lab.say("leader.estop = false; leader.shoulder_pan.val = 0.3;", 1.0)
    assert leader.bend("shoulder_pan") * STEP == pytest.approx(0.3, abs=0.01)


def test_a_leader_that_is_unplugged_leaves_the_follower_where_it_is() -> None:
    leader = So101(calibrated=True)
    lab = _teleoperation(leader)
    leader.hold("shoulder_pan", 300)
    lab.run(0.5)
    lab.leader_end.unplug()
    lab.run(2)
    assert lab.look("leader.link") == "false"
    assert lab.bend("shoulder_pan") == pytest.approx(300 * STEP, abs=0.01)
    # It may stand elsewhere when it is back: the follower does not jump there.
    leader.hold("shoulder_pan", 100)
    lab.leader_end.replug()
    lab.run(4)
    assert lab.look("leader.link") == "true"
    assert lab.bend("shoulder_pan") == pytest.approx(300 * STEP, abs=0.01)
    assert lab.say(TELEOPERATION, 3.0) == ""
    assert lab.bend("shoulder_pan") == pytest.approx(100 * STEP, abs=0.01)


def test_the_teleoperation_begins_again_any_number_of_times_from_any_connection() -> None:
    leader = So101(calibrated=True)
    lab = _teleoperation(leader)
    for place in (200, -200, 300):
        lab.leader_end.unplug()
        lab.run(1)
        lab.leader_end.replug()
        leader.hold("shoulder_pan", place)
        lab.until(lambda: lab.look("leader.link") == "true")
        # The one that loaded it before is gone, and with it what it had set up.
        lab.lobby.close()
        lab.lobby = lab.kernel.open_lobby()
        assert lab.say(TELEOPERATION, 3.0) == ""
        assert lab.bend("shoulder_pan") == pytest.approx(place * STEP, abs=0.01)
    lab.leader_end.unplug()
    lab.run(1)
    leader.hold("shoulder_pan", 0)
    lab.leader_end.replug()
    lab.run(4)
    assert lab.bend("shoulder_pan") == pytest.approx(300 * STEP, abs=0.01)


def test_what_the_leader_lacks_is_told_of_the_leader(caplog: pytest.LogCaptureFixture) -> None:
    leader = So101(calibrated=True)
    leader.remove(leader.servo(3))
    lab = Lab.ready(leader=leader)
    lab.run(2)
    assert [record.getMessage() for record in caplog.records] == ["leader: missing: elbow_flex (id 3)"]


def test_a_leader_that_is_not_there_is_told_once_and_joins_later(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab(leader=So101(calibrated=True))
    lab.leader_end.unplug()
    lab.until(lambda: bool(lab.opened))
    lab.run(3)
    assert lab.opened == [None]
    assert caplog.text.count("leader: ") == 1
    lab.leader_end.replug()
    lab.until(lambda: lab.look("leader.link") == "true" and lab.look("leader.motors.size") == "6")


def test_a_stop_ends_the_teleoperation() -> None:
    leader = So101(calibrated=True)
    lab = _teleoperation(leader)
    lab.look("so101.stop")
    lab.run(0.2)
    leader.hold("shoulder_pan", 300)
    lab.run(1)
    assert abs(lab.bend("shoulder_pan")) < 0.01


def test_calibrated_arms_agree_though_their_servos_do_not(tmp_path: Path) -> None:
    leader, follower = So101(), So101(calibrated=True)
    joints = {
        name: JointCalibration(joint.id, 0, 0, joint.middle - 1000, joint.middle + 1000)
        for name, joint in JOINTS.items()
    }
    save(tmp_path / "leader.json", joints)
    lab = Lab.ready(
        follower,
        leader,
        calibration=_calibration(tmp_path / "follower.json", follower),
        leader_calibration=str(tmp_path / "leader.json"),
    )
    lab.until(lambda: lab.look("leader.motors.size") == "6")
    leader.hold("wrist_flex", 250)
    lab.say(TELEOPERATION, 3.0)
    assert lab.bend("wrist_flex") == pytest.approx(250 * STEP, abs=0.01)


def test_the_joints_of_the_manifest_are_those_of_the_arm() -> None:
    assert platforms.find("so101").joints == arm.JOINTS


def test_limits_name_the_joints_of_the_arm() -> None:
    settings = {"gripper": {"speed": 1.0}, "motor3": {"speed": 1.0}}
    assert list(platforms.mistakes(platforms.find("so101"), {}, settings, {})) == []
