"""Ways that are little wider than the robot: found wherever the walls lie to the grid, and driven in their middle."""

from __future__ import annotations

import math
from typing import cast

import pytest

from urbihw.navigation.base import DrivenBase
from urbihw.navigation.drive import DriveLimits, State
from urbihw.navigation.follow import NARROW_SPEED, STUCK_MARGIN, PathFollower, Tolerance
from urbihw.navigation.frames import Point, Pose, moved
from urbihw.navigation.grid import Grid
from urbihw.navigation.obstacles import close_by
from urbihw.navigation.options import NavigationOptions
from urbihw.navigation.planner import NoPath, Room, plan
from urbihw.navigation.standing import is_clear
from urbihw.navigation.view import NavigatorView

RADIUS = 0.25
ROOM = Room(RADIUS + 0.05, RADIUS + 0.01)
START, GOAL = (1.0, 1.0), (5.0, 3.0)
OFFSETS = [0.0, 0.012, 0.025, 0.037, 0.05, 0.071]


def turned(x: float, y: float, degrees: float) -> Point:
    """A point of the plan after a turn of it."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return c * x - s * y, s * x + c * y


def two_rooms(width: float, offset: float, degrees: float = 0.0, cell: float = 0.1) -> Grid:
    """Two rooms of 2 by 4 m with a corridor of 2 m between them, whose middle is at y = 2 + offset."""
    low, high = 2 + offset - width / 2, 2 + offset + width / 2
    made = Grid(-4, -1, 7, 8, cell)
    for wall in (
        (0, 0, 2, 0), (0, 4, 2, 4), (0, 0, 0, 4), (2, 0, 2, low), (2, high, 2, 4), (2, low, 4, low), (2, high, 4, high),
        (4, 0, 4, low), (4, high, 4, 4), (4, 0, 6, 0), (4, 4, 6, 4), (6, 0, 6, 4),
    ):  # fmt: skip
        x1, y1, x2, y2 = wall
        made.block_line(*turned(x1, y1, degrees), *turned(x2, y2, degrees))
    return made


def test_distances_to_walls_do_not_depend_on_the_cells() -> None:
    for offset in OFFSETS:
        made = Grid(0, 0, 4, 4, 0.1)
        made.block_line(0, 2 + offset, 4, 2 + offset)
        made.block_box(1 + offset, 3, 2 + offset, 3.53)
        assert made.nearest(1.7, 1.4, 1.0).distance == pytest.approx(0.6 + offset)
        assert made.nearest(2.2 + offset, 3.3, 1.0).distance == pytest.approx(0.2)
        assert made.nearest(1.5, 3.83, 1.0).distance == pytest.approx(0.3)
    slanting = Grid(0, 0, 4, 4, 0.1)
    slanting.block_line(0, 0.03, 4, 4.03)
    assert slanting.nearest(2.5, 2.03, 1.0).distance == pytest.approx(math.sqrt(0.125))
    assert slanting.nearest(2.5, 0.03, 1.0).distance == 1.0


def test_a_box_of_pixels_fills_its_cells() -> None:
    made = Grid(0, 0, 4, 4, 0.1)
    for row in range(20):
        made.block_box(1.0, 1 + 0.05 * row, 2.0, 1.05 + 0.05 * row)
    assert made.nearest(1.5, 1.5, 1.0).distance < 0.01
    assert made.nearest(0.7, 1.5, 1.0).distance == pytest.approx(0.3)
    assert made.nearest(1.5, 2.4, 1.0).distance == pytest.approx(0.4)


@pytest.mark.parametrize("degrees", [0.0, 17.0, 45.0])
@pytest.mark.parametrize("offset", OFFSETS)
def test_a_corridor_five_centimetres_wider_than_the_robot_is_a_way(offset: float, degrees: float) -> None:
    grid = two_rooms(0.55, offset, degrees)
    path = plan(grid, turned(*START, degrees), turned(*GOAL, degrees), ROOM)
    assert all(is_clear(grid, a, b, RADIUS + 0.008) for a, b in zip(path, path[1:], strict=False))
    assert len(path) <= 12


@pytest.mark.parametrize("offset", OFFSETS)
def test_without_eyes_the_robot_keeps_its_clearance(offset: float) -> None:
    blind = Room(ROOM.clear, ROOM.clear)
    with pytest.raises(NoPath, match=r"no way leads there that is 0.60 m wide"):
        plan(two_rooms(0.58, offset), START, GOAL, blind)
    path = plan(two_rooms(0.62, offset), START, GOAL, blind)
    assert all(is_clear(two_rooms(0.62, offset), a, b, 0.29) for a, b in zip(path, path[1:], strict=False))


@pytest.mark.parametrize("offset", OFFSETS)
def test_a_corridor_that_is_too_narrow_is_none(offset: float) -> None:
    with pytest.raises(NoPath, match=r"no way leads there that is 0.52 m wide, as this robot needs"):
        plan(two_rooms(0.51, offset), START, GOAL, ROOM)


def test_a_wide_way_is_taken_though_it_is_longer() -> None:
    grid = two_rooms(0.55, 0.0)
    for index in range(len(grid.blocked)):
        x, y = grid.middle(index % grid.width, index // grid.width)
        if y > 3.9 and (1.0 < x < 1.9 or 4.2 < x < 5.1):
            grid.blocked[index] = 0
    path = plan(grid, START, GOAL, ROOM)
    assert max(y for _, y in path) > 4.2


def test_an_obstacle_in_a_narrow_way_closes_it() -> None:
    with pytest.raises(NoPath):
        plan(two_rooms(0.6, 0.0), START, GOAL, ROOM, [(3.0, 1.75)])


class Walker:
    """A robot without inertia on a path between walls, which it sees."""

    def __init__(self, grid: Grid, path: list[Point], pose: Pose) -> None:
        self.grid, self.at = grid, pose
        self.follow = PathFollower(path, 0.0, DriveLimits(), self, Tolerance())

    def pose(self) -> Pose:
        """Where it is."""
        return self.at

    def fastest(self) -> float:
        """As fast as it can."""
        return math.inf

    def free_way(self, curvature: float, narrow: bool) -> float:
        """Nothing stands in its way."""
        return math.inf

    def is_narrow(self, a: Point, b: Point, margin: float) -> bool:
        """As ``NavigatorView`` has it."""
        return not is_clear(self.grid, a, b, ROOM.clear + margin)


@pytest.mark.parametrize("degrees", [0.0, 17.0])
def test_a_narrow_way_is_driven_slowly_and_without_a_touch(degrees: float) -> None:
    grid = two_rooms(0.55, 0.037, degrees)
    path = plan(grid, turned(*START, degrees), turned(*GOAL, degrees), ROOM)
    walker, v, w, time = Walker(grid, path, (*path[0], math.radians(degrees))), 0.0, 0.0, 0.0
    nearest, fastest = math.inf, 0.0
    while (speeds := walker.follow.speeds(State(time, v, w))) is not None:
        # What it is told acts one packet later.
        walker.at = moved(walker.at, v * 0.1, w * 0.1)
        (v, w), time = speeds, time + 0.1
        room = grid.nearest(*walker.at[:2], 1.0).distance
        nearest = min(nearest, room)
        if room < 0.28:
            fastest = max(fastest, v)
        assert time < 90
    assert nearest > RADIUS + 0.005
    assert fastest <= NARROW_SPEED


class Sure:
    """What keeps the pose, and knows it well."""

    is_sure = True


class Beside:
    """A base without inertia that sees the corners and sides of a crate which its map does not show."""

    radius = RADIUS
    scanner = None

    def __init__(self, crate: list[Point], pose: Pose) -> None:
        self.navigation = NavigationOptions(clearance=ROOM.clear - RADIUS)
        self.odometry, self.absolute = self, pose
        self._crate = crate

    def obstacles(self) -> list[Point]:
        """The crate, from the middle of the base."""
        x, y, heading = self.absolute
        c, s = math.cos(heading), math.sin(heading)
        return [(c * (px - x) + s * (py - y), c * (py - y) - s * (px - x)) for px, py in self._crate]


def test_a_way_beside_an_obstacle_that_the_map_does_not_show_is_driven_slowly_and_not_given_up() -> None:
    grid = Grid(0, 0, 10, 10, 0.1)
    grid.block_line(10, 0, 10, 10)
    # 0.8 m remain between its right side and the wall; the robot wants 2 x 0.3 m.
    crate = [(9.2 - 0.6 * far / 30, 5.5) for far in range(31)] + [(9.2, 4.9 + 0.02 * up) for up in range(31)]
    base = Beside(crate, (9.5, 5.7, math.radians(-84)))
    view = NavigatorView(cast("DrivenBase", base), Sure())
    path = plan(grid, base.absolute[:2], (9.4, 3.0), ROOM, crate)
    view.grid, view.beside = grid, close_by(crate, path, ROOM.clear + STUCK_MARGIN)
    follow = PathFollower(path, math.radians(-90), DriveLimits(), view, Tolerance())
    v, w, time, nearest, fastest = 0.0, 0.0, 0.0, math.inf, 0.0
    while (speeds := follow.speeds(State(time, v, w))) is not None:
        base.absolute = moved(base.absolute, v * 0.1, w * 0.1)
        (v, w), time = speeds, time + 0.1
        room = min(math.dist(each, base.absolute[:2]) for each in crate)
        nearest = min(nearest, room)
        if room < ROOM.clear:
            fastest = max(fastest, v)
        assert time < 60
    assert not follow.blocked and nearest > RADIUS
    assert fastest <= NARROW_SPEED
