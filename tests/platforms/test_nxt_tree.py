"""The TriBot after the standard robot API: it goes, turns and knows where it is."""

from __future__ import annotations

import math

import pytest
from nxt_lab import Lab

from urbihw_fakes.nxt.tribot import TriBot


def test_the_tree() -> None:
    lab = Lab.ready()
    assert lab.say("robot.flatDump;").replace("*** ", "").split("\n") == [
        "Battery: battery",
        "DistanceSensor: sonar",
        "Identity: robot",
        "Mobile: robot",
        "Motor: claw",
        "Network: robot",
        "RotationalMotor: wheelL wheelR",
        "Sensor: light decibel",
        "TouchSensor: bumper",
    ]
    assert lab.say("robot.body.wheel[left] === wheelL; robot.model; robot.serial; robot.type;") == (
        'true\n"LEGO MINDSTORMS NXT"\n"00:16:53:01:02:03"\n"wheeled"'
    )


def test_it_goes_and_turns_and_knows_where_it_is() -> None:
    robot = TriBot()
    lab = Lab.ready(robot)
    lab.say("robot.go(0.5);", 5)
    assert robot.x == pytest.approx(-1.0, abs=0.02)
    assert robot.y == pytest.approx(0, abs=0.01)
    lab.say("robot.turn(-pi/2);", 5)
    assert robot.heading == pytest.approx(math.pi / 2, abs=0.04)
    lab.say("robot.go(-0.2);", 3)
    assert robot.y == pytest.approx(-0.2, abs=0.02)
    assert lab.number('robot.position["x"]') == pytest.approx(robot.x + 1.5, abs=0.02)
    assert lab.number('robot.position["y"]') == pytest.approx(robot.y, abs=0.02)
    assert lab.number('robot.position["theta"]') == pytest.approx(robot.heading, abs=0.02)


def test_speeds_in_si_units() -> None:
    robot = TriBot(9.0)
    lab = Lab.ready(robot)
    lab.say("robot.xSpeed = 0.2;", 5)
    assert robot.x == pytest.approx(-8.0, abs=0.05)
    lab.say("robot.stop;", 0.5)
    assert lab.powers() == [0, 0, 0]
