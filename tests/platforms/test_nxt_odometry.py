"""The odometry of an NXT after pauses: a pulled cable, a killed worker, late readings, a brick that was off."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from motions import Kind, Scene
from nxt_lab import MOTION, Lab

from urbihw.platforms.nxt.navigation import NxtWheels
from urbihw_fakes.nxt.tribot import TriBot

START = 100.0


class SlowLab(Lab):
    """With ticks so long that a pause can begin between the readings of the two wheels."""

    tick = 0.02


def error_of(lab: Lab) -> tuple[float, float]:
    """Metres and radians between the odometry and the body."""
    x, y = lab.tribot.x + START, lab.tribot.y
    away = abs(complex(lab.number("nxt.odometry.x") - x, lab.number("nxt.odometry.y") - y))
    return away, abs(math.remainder(lab.number("nxt.odometry.yaw") - lab.tribot.heading, math.tau))


def wheels_of(lab: Lab) -> NxtWheels:
    """What gets the readings of the encoders."""
    robot: Any = lab.robot
    wheels: NxtWheels = robot._wheels
    return wheels


@pytest.mark.parametrize("lead", range(6))
def test_a_pulled_cable_loses_no_way(lead: int) -> None:
    lab = SlowLab.ready(TriBot(START))
    lab.say("wheels.speed = 50;", 1.0 + lead * lab.tick)
    lab.unplug()
    lab.run(2.0)
    lab.end.replug()
    lab.run(3.0)
    assert lab.tribot.x + START > 0.5, "the brick drives on without the cable"
    away, turned = error_of(lab)
    assert away < 0.02
    assert turned < 0.1


@pytest.mark.parametrize("lead", range(6))
def test_a_killed_worker_loses_no_way(lead: int, tmp_path: Path) -> None:
    scene = Scene(MOTION, Kind("", 0.0, make=lambda: SlowLab.ready(TriBot(START))), tmp_path, [])
    lab = scene.lab
    lab.say("wheels.speed = 50;", 1.0 + lead * lab.tick)
    scene.worker_killed(3.0)
    scene.run(3.0)
    away, turned = error_of(lab)
    assert away < 0.02
    assert turned < 0.1


def test_a_silent_brick_loses_no_way() -> None:
    lab = SlowLab.ready(TriBot(START))
    for pause in (0.1, 0.25, 0.4, 0.7, 1.5):
        lab.say("wheels.speed = 50;", 1.0)
        lab.device.faults.start("silence")
        lab.run(pause)
        lab.device.faults.stop("silence")
        lab.run(3.0)
    away, turned = error_of(lab)
    assert away < 0.04
    assert turned < 0.1


def test_readings_of_before_are_not_counted_twice() -> None:
    lab = Lab.ready(TriBot(START))
    lab.say("wheels.speed = 50;", 2.0)
    wheels, now = wheels_of(lab), lab.robot.host.now()
    before = lab.number("nxt.odometry.x")
    for place in "CA":
        # What a worker that was killed had measured, read after the first readings of the next one.
        wheels.add_reading(place, 5.0, now - 3.0)
    lab.run(0.5)
    assert lab.number("nxt.odometry.x") - before == pytest.approx(0.5 * 0.22, abs=0.02)


@pytest.mark.parametrize(("first", "second"), ["CA", "AC"])
@pytest.mark.parametrize("lone", ["", "C", "A"])
def test_a_pause_between_the_readings_of_the_wheels(first: str, second: str, lone: str) -> None:
    lab = Lab.ready(TriBot(START))
    add, now = wheels_of(lab).add_reading, lab.robot.host.now() + 1.0
    for place in "CA":
        add(place, 0.0, now)
    if lone:
        add(lone, 10.0, now + 0.02)
    add(first, 1350.0, now + 3.0)
    add(second, 1350.0, now + 3.002)
    add(first, 1360.0, now + 3.02)
    add(second, 1360.0, now + 3.022)
    assert lab.number("nxt.odometry.x") == pytest.approx(math.radians(1360) * 0.028, abs=0.001)
    assert lab.number("nxt.odometry.yaw") == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("seconds", [0.5, 3.0])
def test_a_brick_that_was_switched_off_keeps_its_place(seconds: float) -> None:
    lab = Lab.ready(TriBot(START))
    # One wheel has turned a lot, the other hardly at all.
    lab.say("wheelL.speed = 50; wheelR.speed = 0;", 3.0)
    lab.say("wheelL.speed = 0;", 1.0)
    lab.device.power_off(lab.bus_clock.now())
    lab.run(seconds)
    lab.device.power_on(lab.bus_clock.now())
    lab.run(4.0)
    away, turned = error_of(lab)
    assert away < 0.03
    assert turned < 0.1
