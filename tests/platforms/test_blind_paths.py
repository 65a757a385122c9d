"""A path does not go on without the laser it began with, nor by scans that contradict the wheels; nor does it begin."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from p3dx_lab import Lab

from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.world import World

EVENTS = (
    'at (P3dx.planner.pathPlanningEvent?(var how)) echo("path %s" % how);'
    'at (P3dx.planner.locFailureEvent?(var why)) echo("lost: " + why);'
)
AHEAD = "P3dx.moveTo([2.4, 0, 0]);"


def ready(folder: Path, localization: str = "odometry", world: World | None = None) -> Lab:
    """A robot on its map; its laser is on, its sonars are off."""
    lab = Lab.ready(Kit(world, slip=0.0, laser="lms1xx"), laser_model="lms1xx", localization=localization)
    lab.say("P3dx.body.load = 1; P3dx.body.laser.load = 1; P3dx.body.sonar.load = 0;", 2)
    lab.say(EVENTS)
    name_map(lab, lab.write_map(folder))
    assert lab.look("P3dx.planner.ready") == "true"
    return lab


def name_map(lab: Lab, path: str) -> None:
    """Let it read a map."""
    lab.say(f'P3dx.planner.mapFileName = "{path}";')
    pass_time(lab, 0.5)


def pass_time(lab: Lab, seconds: float, until: str = "") -> str:
    """Let time go by, with the threads of the planner, ``until`` something is said; what is said."""
    said = ""
    for _ in range(round(seconds * 10)):
        lab.thought()
        lab.run(0.1)
        said += lab.heard()
        if until and until in said:
            break
    return said


def arrives(lab: Lab) -> bool:
    """Whether the path ends well, within half a minute; the robot then stands."""
    there = "path 1" in pass_time(lab, 30, "path 1")
    pass_time(lab, 0.5)
    return there


class Stuck:
    """The body of a laser that sends one scan for ever."""

    def __init__(self, body: Any) -> None:
        self.pose, self.world = body.pose, body.world

    def advance(self, now: float) -> None:
        """Nothing changes."""


@pytest.mark.parametrize("localization", ["odometry", "scan"])
def test_a_path_stands_at_once_and_ends_when_the_laser_is_gone(tmp_path: Path, localization: str) -> None:
    lab = ready(tmp_path, localization)
    lab.say(AHEAD)
    pass_time(lab, 2)
    assert lab.kit.body.moving
    lab.laser_line.end.unplug()
    said = pass_time(lab, 3)
    stood = lab.where()
    assert not lab.kit.body.moving and lab.look("P3dx.planner.active") == "true"
    said += pass_time(lab, 5)
    assert "path 0" in said
    assert lab.where() == stood
    assert "no scan" in lab.look("P3dx.planner.failure")
    is_known = localization == "odometry"
    assert lab.look("P3dx.planner.ready") == str(is_known).lower()
    assert ("lost: the laser has sent no scan" in said) is not is_known
    why = "is switched on and sends no scan" if is_known else "localization by scans needs the laser"
    assert why in lab.say(AHEAD)
    lab.laser_line.end.replug()
    pass_time(lab, 8)
    assert lab.look("P3dx.planner.ready") == "true"
    lab.say(AHEAD)
    assert arrives(lab)
    assert math.dist(lab.where()[:2], (2.4, 0)) < 0.1


def test_a_silent_laser_counts_as_gone_and_a_short_silence_only_pauses(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    lab.say(AHEAD)
    pass_time(lab, 2)
    tick, lab.kit.laser.tick = lab.kit.laser.tick, lambda now: []
    assert pass_time(lab, 2.6) == "" and not lab.kit.body.moving
    lab.kit.laser.tick = tick
    assert arrives(lab)
    assert math.dist(lab.where()[:2], (2.4, 0)) < 0.1


def test_a_path_without_a_laser_that_was_on_is_not_stopped_by_it(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    lab.say("P3dx.body.laser.load = 0;", 0.5)
    lab.say(AHEAD)
    assert arrives(lab)


def test_a_stuck_laser_makes_the_robot_lost(tmp_path: Path) -> None:
    world = World([(-1, -3, 20, -3), (20, -3, 20, 3), (20, 3, -1, 3), (-1, 3, -1, -3), (5, -3, 5, -2), (9, 3, 9, 2)])
    lab = ready(tmp_path, "scan", world)
    lab.kit.laser.body = Stuck(lab.kit.body)
    lab.say("P3dx.moveTo([9, 0, 0]);")
    said = pass_time(lab, 12)
    assert "path 2" in said and "the scans do not change as they should" in said
    assert lab.where()[0] < 2
    assert not lab.kit.body.moving and lab.look("P3dx.planner.ready") == "false"


def test_a_stuck_laser_is_noticed_in_a_turn(tmp_path: Path) -> None:
    lab = ready(tmp_path, "scan")
    lab.kit.laser.body = Stuck(lab.kit.body)
    lab.say("P3dx.body.yaw.speed = 0.5;")
    assert "the scans do not change as they should" in pass_time(lab, 6, "as they should")


def test_a_robot_that_was_pushed_while_it_stood_is_not_lost(tmp_path: Path) -> None:
    lab = ready(tmp_path, "scan")
    for step in range(1, 6):
        lab.kit.body.set_pose(0.2 * step, 0, 0)
        assert pass_time(lab, 0.5) == ""
    lab.say(AHEAD)
    assert arrives(lab)
    assert math.dist(lab.where()[:2], (2.4, 0)) < 0.1


def test_a_lost_robot_refuses_goals(tmp_path: Path) -> None:
    lab = ready(tmp_path, "scan")
    lab.kit.body.set_pose(-1, 2, 1.5)
    assert "lost: " in pass_time(lab, 3)
    assert "the robot is lost on the map: turn or drive it" in lab.say(AHEAD)
    assert lab.look("P3dx.planner.active") == "false"


@pytest.mark.parametrize("position", ["[1e308, 1e308, 0, 0]", "[0, -20000, 0, 0]"])
def test_a_place_that_no_map_has_is_refused(tmp_path: Path, position: str) -> None:
    lab = ready(tmp_path)
    lab.say(AHEAD)
    assert "no map goes farther than 10000 m" in lab.say(f"P3dx.body.odometry.position = {position};")
    assert arrives(lab)
    assert math.dist(lab.where()[:2], (2.4, 0)) < 0.1


def test_a_map_that_cannot_be_one_is_an_error_at_once_and_the_old_one_stays(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    (tmp_path / "room.txt").write_text("2D-Map")
    assert "/no/such.map: there is no such file" in lab.say('P3dx.planner.mapFileName = "/no/such.map";')
    assert "maps end in .map" in lab.say(f'P3dx.planner.mapFileName = "{tmp_path}/room.txt";')
    assert lab.look("P3dx.planner.mapFileName") == f'"{tmp_path}/room.map"'
    lab.say(AHEAD)
    assert arrives(lab)
    (tmp_path / "bad.map").write_text("walls")
    name_map(lab, f"{tmp_path}/bad.map")
    assert "begins with 2D-Map" in lab.look("P3dx.planner.failure")


def test_a_path_replaces_a_movement_and_its_errors_name_moveto_alone(tmp_path: Path) -> None:
    lab = ready(tmp_path)
    lab.say("robot.go(-2),")
    pass_time(lab, 2)
    assert lab.where()[0] < -0.1
    (error,) = lab.say("P3dx.moveTo([50, 0, 0]);").splitlines()
    assert "moveTo: the goal (50, 0) is outside the map" in error
    lab.say(AHEAD)
    assert arrives(lab)
    assert math.dist(lab.where()[:2], (2.4, 0)) < 0.1
