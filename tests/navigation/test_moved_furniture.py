"""The pose on a map of which some things are not where they were: it stays right, and nobody is lost for that."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from urbihw.navigation.background import Background
from urbihw.navigation.base import Echo
from urbihw.navigation.belief import Belief, Symmetric
from urbihw.navigation.frames import ORIGIN, Pose, compose, frame_of, moved, wrapped
from urbihw.navigation.grid import Grid
from urbihw.navigation.localize import CELL
from urbihw.navigation.locator import MAX_MISFITS, Locator
from urbihw.navigation.maps import Bounds
from urbihw_fakes.p3dx.world import Wall, World, box

PLACE = 0.021
SLIP = 0.02
FARTHEST = 8.0


class Wheels:
    """The odometry of a robot whose wheels slip, and where it truly is."""

    def __init__(self, pose: Pose) -> None:
        self.truth = pose
        self.odometric, self.frame = ORIGIN, pose
        self.placed: Callable[[], None] = lambda: None

    @property
    def absolute(self) -> Pose:
        """Where it believes to be."""
        return compose(self.frame, self.odometric)

    def absolute_at(self, stamp: float) -> Pose:
        """The same: time stands still between the scans."""
        return self.absolute

    def correct(self, pose: Pose, stamp: float | None = None) -> None:
        """Believe to be there."""
        self.frame = frame_of(pose, self.odometric)

    def drive(self, way: float, turn: float) -> None:
        """Turn the wheels."""
        self.odometric = moved(self.odometric, way, turn)
        self.truth = moved(self.truth, way * (1 - SLIP), turn * (1 - SLIP))

    def off(self) -> float:
        """How far it is from where it believes to be, m."""
        return math.dist(self.absolute[:2], self.truth[:2])


class AtOnce(Background):
    """Work that is done when it is begun."""

    def __init__(self) -> None:
        super().__init__(lambda act: act(), ())

    def start(self, work: Callable[[], Any], done: Callable[[Any], None], failed: Callable[[Exception], None]) -> None:
        done(work())


class Robot:
    """A robot that finds its way by scans in a world that differs from its map."""

    def __init__(self, shown: list[Wall], real: list[Wall], bounds: Bounds, pose: Pose) -> None:
        walls = Grid(*bounds, CELL)
        for wall in shown:
            walls.block_line(*wall)
        self.world, self.wheels = World(real, pose), Wheels(pose)
        self.lost: list[str] = []
        self.locator = Locator(self.wheels, AtOnce(), lambda: None, lambda why, searching: self.lost.append(why))
        self.locator.use_map(walls)
        self.worst = 0.0

    def look(self, scans: int = 1) -> None:
        """Take some scans."""
        for _ in range(scans):
            self.locator.take_scan(self._scan(), PLACE, 0.0)
            self.worst = max(self.worst, self.wheels.off())

    def drive(self, way: float, turn: float = 0.0, steps: int = 1) -> None:
        """Drive, with a scan after each step."""
        for _ in range(steps):
            self.wheels.drive(way / steps, turn / steps)
            self.look()

    def _scan(self) -> list[Echo]:
        x, y, heading = compose(self.wheels.truth, (PLACE, 0.0, 0.0))
        angles = [math.radians(degrees) for degrees in range(-90, 91, 2)]
        ranges = self.world.rays(x, y, [heading + angle for angle in angles], FARTHEST)
        return [(r, angle) for r, angle in zip(ranges, angles, strict=True) if r < FARTHEST]


def crate(x: float, y: float, side: float = 0.6) -> list[Wall]:
    """One with its middle there."""
    return box(x - side / 2, y - side / 2, x + side / 2, y + side / 2)


HALL = [(0.0, -1.5, 40.0, -1.5), (0.0, 1.5, 40.0, 1.5)]
"""Two walls that are so long that the laser sees neither end."""


@pytest.mark.parametrize("by", [0.4, 0.5, 0.6, 1.0])
def test_a_moved_crate_between_long_walls_does_not_pull_the_pose_along_them(by: float) -> None:
    robot = Robot([*HALL, *crate(18, 0.9)], [*HALL, *crate(18 + by, 0.9)], (0, -1.5, 40, 1.5), (12.0, -0.5, 0.0))
    robot.look(3)
    robot.drive(10.0, steps=80)
    assert not robot.lost and robot.locator.found
    # The slip of 10 m, which nothing corrects there.
    assert robot.worst < 10 * SLIP + 0.1
    assert not robot.locator.is_precise
    assert abs(robot.wheels.absolute[1] - robot.wheels.truth[1]) < 0.02


ROOM = box(0, 0, 8, 6)
SHOWN = [(2.0, 1.5), (4.0, 3.2), (6.2, 1.6), (1.5, 4.6), (6.5, 4.4), (4.2, 5.2)]
MOVED = [(2.0, 1.5), (3.2, 2.4), (5.4, 1.2), (1.5, 4.6), (6.5, 3.4), (4.2, 5.2)]


def furnished(places: list[tuple[float, float]]) -> list[Wall]:
    """The room with crates."""
    return [*ROOM, *(wall for place in places for wall in crate(*place))]


@pytest.mark.parametrize("turn", [0.0, 0.35, -0.35])
def test_in_a_room_whose_crates_were_moved_the_pose_stays_right(turn: float) -> None:
    robot = Robot(furnished(SHOWN), furnished(MOVED), (0, 0, 8, 6), (1.0, 3.2, 0.0))
    robot.look(3)
    for _ in range(4):
        robot.drive(0.9, turn, steps=8)
        robot.drive(0.0, math.pi / 2 - turn, steps=12)
    assert not robot.lost and robot.locator.is_precise
    assert robot.worst < 0.04


def test_a_pose_that_is_told_among_moved_crates_is_kept() -> None:
    robot = Robot(furnished(SHOWN), furnished(MOVED), (0, 0, 8, 6), (4.2, 2.0, math.pi / 2))
    robot.wheels.correct((4.3, 1.95, math.pi / 2 + 0.05))
    robot.look(30)
    assert not robot.lost and robot.locator.found
    assert robot.wheels.off() < 0.03


def test_a_robot_that_was_pushed_finds_its_place_nearby() -> None:
    robot = Robot(furnished(SHOWN), furnished(SHOWN), (0, 0, 8, 6), (1.0, 3.2, 0.0))
    robot.look(3)
    x, y, heading = robot.wheels.truth
    robot.wheels.truth = (x + 0.3, y - 0.45, heading + 0.3)
    robot.look(2 * MAX_MISFITS)
    assert not robot.lost
    assert robot.wheels.off() < 0.03


def test_a_robot_that_was_carried_is_lost() -> None:
    robot = Robot(furnished(SHOWN), furnished(MOVED), (0, 0, 8, 6), (1.0, 3.2, 0.0))
    robot.look(3)
    robot.wheels.truth = (7.2, 2.4, 2.0)
    robot.look(8 * MAX_MISFITS)
    assert len(robot.lost) == 1
    assert not robot.locator.found


def test_a_crowd_before_the_laser_says_nothing() -> None:
    robot = Robot(furnished(SHOWN), furnished(SHOWN), (0, 0, 8, 6), (1.0, 3.2, 0.0))
    robot.look(3)
    around = [math.radians(degrees) for degrees in range(-90, 91, 15)]
    crowd = [wall for a in around for wall in crate(1 + 0.7 * math.cos(a), 3.2 + 0.7 * math.sin(a), 0.25)]
    robot.world.walls += crowd
    robot.look(12 * MAX_MISFITS)
    assert not robot.lost and robot.locator.found
    assert not robot.locator.is_sure
    assert robot.wheels.off() < 0.03
    robot.world.walls = robot.world.walls[: -len(crowd)]
    robot.look()
    assert robot.locator.is_sure


def test_the_belief_widens_along_the_way_and_narrows_where_a_scan_tells() -> None:
    belief = Belief()
    belief.measure(ORIGIN, Symmetric(1e4, 1e4, 1e4))
    known = belief.spread
    for step in range(1, 41):
        belief.move((step * 0.1, 0.0, 0.0))
        held = belief.information()
        # A wall along the way tells its distance and its direction.
        belief.measure((step * 0.1, 0.0, 0.0), held + Symmetric(0.0, 1e4, 1e4))
    assert belief.spread > 4 * known
    held = belief.information()
    assert held.yy > 20 * held.xx
    unit = held.inverse().times(*held.times(1.0, 2.0, 3.0))
    assert unit == pytest.approx((1.0, 2.0, 3.0))
    assert wrapped(unit[2]) == pytest.approx(3.0)
