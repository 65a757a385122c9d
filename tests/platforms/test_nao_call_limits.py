"""Limits of the settings hold for calls of services: it is known before what a call lets move, or the call is
refused."""

from __future__ import annotations

import pytest
from nao_lab import Lab, stand

LIMITS = {"HeadYaw": {"position": [-0.5, 0.5], "speed": 2.0}, "walk": {"speed": 0.05, "turn": 0.3}}
ANY = "nao.endOf(nao.callService"
"""Calls a method that the simulated robot does not have."""
PLACE, SPEED = "limits.HeadYaw.position", "limits.HeadYaw.speed"


@pytest.fixture
def lab() -> Lab:
    """A robot on its feet, with limits."""
    made = Lab.ready(limits=LIMITS)
    stand(made.device.body)
    made.run(0.2)
    return made


@pytest.mark.parametrize(
    ("call", "limit"),
    [
        ('motion.setAngles("HeadYaw", 1, 0.1);', PLACE),
        ('motion.setAngles(["HeadPitch", "HeadYaw"], [0, -1], 0.1);', PLACE),
        ('motion.setAngles("Head", 0.51, 0.1);', PLACE),
        ('motion.setAngles("Body", 0.6, 0.1);', PLACE),
        ('motion.setAngles("HeadYaw", 0.4, 1);', SPEED),
        ('motion.changeAngles("HeadYaw", 0.6, 0.1);', PLACE),
        ('motion.angleInterpolation("HeadYaw", [0.4, 0.8], [2, 4], true);', PLACE),
        ('motion.angleInterpolation(["HeadYaw", "HeadPitch"], [[0.4], [0]], [[0.1], [1]], true);', SPEED),
        ('motion.angleInterpolation("HeadYaw", 0.6, 4, false);', PLACE),
        ('motion.angleInterpolationWithSpeed("HeadYaw", 0.4, 0.9);', SPEED),
        (f'{ANY}("ALMotion", "angleInterpolationBezier", ["HeadYaw", [[1]], [[[1, [3, 0, 0]]]]]), "");', PLACE),
        (f'{ANY}("ALMotion", "setPosition", ["LArm", 0, [0, 0, 0, 0, 0, 0], 0.5, 7]), "");', PLACE),
        (f'{ANY}("ALMotion", "pCall", ["setAngles", ["HeadYaw", 1, 0.1]]), "");', PLACE),
        (f'{ANY}("ALTracker", "track", ["Face"]), "");', PLACE),
        ('ALRobotPosture.goToPosture("Stand", 0.5);', PLACE),
        ('DCM.set(["HeadYaw/Position/Actuator/Value", "Merge", [[0.9, DCM.getTime(500)]]]);', PLACE),
        ('DCM.set(["Device/SubDeviceList/HeadYaw/Position/Actuator/Value", "Merge", [[0.4, 9]]]);', SPEED),
        ('DCM.createAlias(["mine", ["HeadYaw/Position/Actuator/Value"]]);', PLACE),
        ('DCM.setAlias(["mine", "Merge", "time-mixed", [[[1, 0]]]]);', PLACE),
        ("motion.move(0.1, 0, 0);", "limits.walk.speed"),
        ("motion.move(0, -0.1, 0);", "limits.walk.speed"),
        ("motion.move(0, 0, 0.5);", "limits.walk.turn"),
        ("motion.moveToward(1, 0, 0);", "limits.walk.speed"),
        ("motion.moveTo(0.1, 0, 0);", "limits.walk.speed"),
        ("motion.walkTo(0, 0, 1);", "limits.walk.turn"),
    ],
)
def test_a_call_beyond_a_limit_is_refused_in_one_line(lab: Lab, call: str, limit: str) -> None:
    body = lab.device.body
    said = lab.say(call, 0.5)
    assert limit in said.splitlines()[0], said
    assert body.joints["HeadYaw"].angle == pytest.approx(0.0, abs=0.001) and not body.walking


def test_calls_within_the_limits_are_executed(lab: Lab) -> None:
    body = lab.device.body
    assert lab.say('motion.setAngles("HeadYaw", 0.4, 0.2);', 1.0) == ""
    assert body.joints["HeadYaw"].angle == pytest.approx(0.4, abs=0.01)
    assert lab.say('motion.changeAngles("HeadYaw", -0.2, 0.1);', 1.0) == ""
    assert body.joints["HeadYaw"].angle == pytest.approx(0.2, abs=0.01)
    assert lab.say('motion.setAngles("LElbowYaw", 1.5, 1);', 0.5) == "", "another joint"
    assert lab.say("motion.move(0.05, 0, 0);", 1.0) == ""
    assert body.walk[0] == pytest.approx(0.05, abs=0.001)
    assert lab.say("motion.stopMove; motion.killAll; motion.rest;", 3.0) == ""
    assert not body.joints["HeadYaw"].stiffness


def test_a_limited_hand_and_the_shared_motor_of_the_hips() -> None:
    lab = Lab.ready(limits={"RHand": {"position": [0.2, 0.8]}, "LHipYawPitch": {"position": [-0.1, 0.1]}})
    stand(lab.device.body)
    lab.run(0.2)
    assert "limits.RHand.position" in lab.say('motion.openHand("RHand");', 0.5)
    assert "limits.LHipYawPitch.position" in lab.say('motion.setAngles("RHipYawPitch", 0.5, 0.1);', 0.5)


def test_without_limits_nothing_is_refused() -> None:
    lab = Lab.ready()
    stand(lab.device.body)
    lab.run(0.2)
    assert lab.say('ALRobotPosture.goToPosture("Stand", 0.5); motion.moveTo(0.1, 0, 0);', 6.0) == "true"
    assert lab.device.body.x == pytest.approx(0.1, abs=0.01)


def test_a_limit_of_the_acceleration_lets_naoqi_not_start_by_itself() -> None:
    lab = Lab.ready(limits={"walk": {"acceleration": 0.1}})
    stand(lab.device.body)
    lab.run(0.2)
    assert "limits.walk.acceleration" in lab.say("motion.move(0.01, 0, 0);", 0.5)
    assert lab.say("robot.go(0.1);", 5.0) == ""
    assert lab.device.body.x == pytest.approx(0.1, abs=0.02)
