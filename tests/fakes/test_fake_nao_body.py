"""A Nao in MuJoCo: what its body does, and what ALMemory reads of it."""

from __future__ import annotations

import math
from typing import Any

import pytest

from urbihw_fakes.errors import UnknownRequest
from urbihw_nao_fakes.console import commands, in_world
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.legged import LeggedBody

pytest.importorskip("mujoco", reason="simulated worlds need the extra mujoco")

PREFIX = "Device/SubDeviceList/"


class Robot:
    """A Nao in a world, and its time."""

    def __init__(self, world: str = "flat") -> None:
        self.body = LeggedBody(world)
        self.nao = Nao(body=self.body)
        self.now = 0.0
        self.nao.advance(0.0)

    def run(self, seconds: float) -> Robot:
        """Let some time pass, in steps like those of a client at 50 Hz."""
        for _ in range(round(seconds * 50)):
            self.now += 0.02
            self.nao.advance(self.now)
        return self

    def awake(self) -> Robot:
        """The robot, standing."""
        self.nao.motion.wake_up()
        return self.run(2)

    def read(self, key: str) -> float:
        """A value of ALMemory."""
        return float(self.nao.memory.get_data(f"{PREFIX}{key}/Sensor/Value"))

    def stored(self, key: str) -> Any:
        """What an event has stored."""
        return self.nao.memory.stored.get(key)

    def word(self, line: str) -> str:
        """Say a word to its console."""
        name, *rest = line.split()
        words = in_world(self.nao, self.body, commands(self.nao, lambda: self.now), lambda: self.now)
        return words[name].run(rest)


def test_it_crouches_without_stiffness_and_stands_up_when_it_wakes() -> None:
    robot = Robot().run(3)
    assert robot.body.height < 0.24 and robot.body.tilt < math.radians(10)
    assert not robot.nao.motion.is_awake()
    robot.nao.motion.wake_up()
    robot.run(10)
    assert robot.body.height == pytest.approx(0.32, abs=0.01) and robot.body.tilt < math.radians(10)
    assert math.hypot(*robot.body.place[:2]) < 0.02 and robot.body.posture_name == "Stand"


def test_it_falls_when_its_stiffness_goes_and_tells_it() -> None:
    robot = Robot().awake()
    assert robot.stored("robotHasFallen") is None
    robot.nao.motion.set_stiffnesses("Body", 0.0)
    robot.run(3)
    assert robot.body.fallen and robot.body.tilt > math.radians(60) and robot.body.height < 0.15
    assert robot.stored("robotHasFallen") == 1 and robot.body.posture_name.startswith("Lying")


def test_rest_leaves_it_crouching_and_slack() -> None:
    robot = Robot().awake()
    rested = robot.nao.motion.rest()
    for _ in range(200):
        robot.run(0.02)
        if rested.ready():
            break
    robot.run(3)
    assert not robot.nao.motion.is_awake() and not robot.body.fallen
    assert robot.body.height < 0.24 and robot.body.tilt < math.radians(15)


@pytest.mark.parametrize(("posture", "height"), [("StandZero", 0.333), ("Crouch", 0.228), ("StandInit", 0.32)])
def test_it_goes_to_a_posture_on_its_feet(posture: str, height: float) -> None:
    robot = Robot().awake()
    way = robot.body.go_to_posture(posture, 0.8)
    robot.run(3)
    assert way.reached() and robot.body.height == pytest.approx(height, abs=0.01) and robot.body.tilt < math.radians(15)


def test_its_head_turns_where_it_is_told_no_faster_than_told() -> None:
    robot = Robot().awake()
    robot.nao.motion.set_angles("HeadYaw", 1.0, 0.1)
    head = robot.body.simulation.body("head")
    torso = robot.body.simulation.pose(robot.body.simulation.body("torso"))[2]
    robot.run(0.5)
    assert robot.body.simulation.pose(head)[2] - torso == pytest.approx(0.41, abs=0.08)
    robot.run(1.5)
    assert robot.body.simulation.pose(head)[2] - torso == pytest.approx(1.0, abs=0.03)
    assert robot.read("HeadYaw/Position") == pytest.approx(1.0, abs=0.03)


def test_a_weak_arm_sags_and_a_slack_one_hangs() -> None:
    robot = Robot().awake()
    robot.nao.motion.set_angles("LShoulderPitch", 0.0, 0.5)
    robot.run(2)
    assert 0.005 < robot.read("LShoulderPitch/Position") < 0.1
    robot.nao.motion.set_stiffnesses("LArm", 0.0)
    robot.run(2)
    assert robot.read("LShoulderPitch/Position") > 1.2 and not robot.body.fallen


def test_a_hard_push_makes_it_fall_with_slack_motors_and_a_light_one_does_not() -> None:
    robot = Robot().awake()
    robot.word("push 5 0")
    assert robot.run(2).body.tilt < math.radians(10)
    robot.word("push 60 0")
    robot.run(3)
    assert robot.body.posture_name == "LyingBelly" and robot.stored("robotHasFallen") == 1
    assert not any(robot.nao.motion.get_stiffnesses("Body"))
    robot.word("stand")
    # Somebody has put it on its feet, but its legs are not stiff yet.
    assert robot.run(3).body.fallen


def test_the_fall_manager_can_be_switched_off() -> None:
    robot = Robot().awake()
    robot.nao.motion.set_fall_manager(False)
    robot.word("push -60 0")
    robot.run(3)
    assert robot.body.posture_name == "LyingBack" and min(robot.nao.motion.get_stiffnesses("LLeg")) == 1.0
    robot.word("place 1 2 90")
    robot.run(1)
    x, y, heading = robot.body.place
    assert (x, y) == pytest.approx((1, 2), abs=0.05) and heading == pytest.approx(math.pi / 2, abs=0.05)
    assert not robot.body.fallen


def test_on_the_floor_a_posture_does_not_raise_it() -> None:
    robot = Robot().awake()
    robot.word("push 60")
    robot.run(3)
    robot.body.go_to_posture("Stand", 1.0)
    robot.run(3)
    assert robot.body.fallen and not robot.body.ready_to_walk()
    robot.word("stand")
    robot.run(3)
    assert not robot.body.fallen and robot.body.tilt < math.radians(10) and robot.body.ready_to_walk()


def test_its_feet_feel_its_weight_and_its_inertial_unit_where_down_is() -> None:
    robot = Robot().awake()
    both = sum(robot.read(f"{foot}/FSR/TotalWeight") for foot in ("LFoot", "RFoot"))
    assert both == pytest.approx(5.305, abs=0.1)
    assert robot.nao.memory.get_data("leftFootContact") == 1.0
    assert -0.03 < robot.read("LFoot/FSR/CenterOfPressure/X") < 0.07
    assert robot.read("InertialSensor/AccelerometerZ") == pytest.approx(9.75, abs=0.2)
    assert robot.read("InertialSensor/AngleY") == pytest.approx(0.1, abs=0.03)
    robot.word("push -60")
    robot.run(3)
    assert robot.read("InertialSensor/AngleY") < -1.0 and robot.read("InertialSensor/AccelerometerZ") < 5


def test_it_walks_and_turns_and_its_odometry_is_nearly_right() -> None:
    robot = Robot().awake()
    robot.nao.motion.walk(0.1, 0.0, 0.0)
    robot.run(5)
    x, y, _ = robot.body.place
    assert x == pytest.approx(robot.body.x, abs=0.05) and 0.4 < x < 0.5 and abs(y) < 0.03
    robot.nao.motion.walk_to(0.0, 0.0, 1.0)
    robot.run(5)
    assert robot.body.place[2] == pytest.approx(1.0, abs=0.2) and not robot.body.walking
    stood = robot.body.place
    assert robot.run(2).body.place == pytest.approx(stood, abs=0.01)


def test_a_crate_stops_its_walk_and_presses_its_bumpers_and_its_sonars_hear_it() -> None:
    robot = Robot().awake()
    assert robot.body.sonars == [2.55, 2.55]
    robot.word("box 0.6 0 0.4")
    robot.run(0.2)
    assert robot.body.sonars == pytest.approx([0.35, 0.35], abs=0.03)
    robot.nao.motion.walk(0.1, 0.0, 0.0)
    robot.run(6)
    assert robot.body.place[0] < 0.32 and robot.body.x > 0.5 and not robot.body.fallen
    assert robot.read("LFoot/Bumper/Right") == 1.0
    robot.nao.motion.walk(-0.1, 0.0, 0.0)
    robot.run(3)
    assert robot.read("LFoot/Bumper/Right") == 0.0 and robot.body.place[0] < 0.25


def test_a_robot_with_slack_legs_does_not_walk_and_falling_ends_a_walk() -> None:
    robot = Robot().run(1)
    robot.body.drive((0.1, 0.0, 0.0))
    assert abs(robot.run(2).body.place[0]) < 0.01
    robot.awake()
    robot.nao.motion.walk(0.1, 0.0, 0.0)
    robot.run(1)
    robot.nao.motion.set_stiffnesses("Body", 0.0)
    robot.run(3)
    assert robot.body.fallen and not robot.body.walking


def test_the_same_program_gives_the_same_motion_in_whatever_rhythm() -> None:
    def end_of(step: float) -> list[float]:
        body = LeggedBody("room")
        body.advance(0.0)
        body.put_on_feet()
        body.drive((0.05, 0.02, 0.2))
        body.push(10.0, 5.0)
        for count in range(round(2.0 / step)):
            body.advance((count + 1) * step)
        return [float(value) for value in body.simulation.data.qpos]

    assert end_of(0.02) == end_of(0.02) == end_of(0.5)


def test_it_moves_on_though_nobody_asks_and_its_words_are_those_of_a_world() -> None:
    robot = Robot()
    assert robot.nao.due() == pytest.approx(0.01)
    words = in_world(robot.nao, robot.body, commands(robot.nao, lambda: robot.now), lambda: robot.now)
    assert {"scene", "stand", "place", "push", "where", "box", "unbox"} <= words.keys() and "sonar" not in words
    assert robot.word("where").endswith("crouching")
    with pytest.raises(UnknownRequest, match="no crate"):
        robot.word("unbox")
