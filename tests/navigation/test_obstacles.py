"""Obstacles that the map does not show: marked by echoes, cleared by rays, faded by time; and the way past them."""

from __future__ import annotations

import math

import pytest

from urbihw.navigation.base import Echo
from urbihw.navigation.frames import Pose
from urbihw.navigation.grid import Grid
from urbihw.navigation.obstacles import (
    FADE_S,
    GONE_AFTER,
    MARK_RANGE,
    STOOD_FADE_S,
    ObstacleLayer,
    closes_path,
    free_way,
)

HERE: Pose = (5.0, 5.0, math.pi / 2)


def layer() -> ObstacleLayer:
    """One over an empty hall of 10 by 10 m."""
    grid = Grid(0, 0, 10, 10, 0.1)
    for wall in ((0, 0, 10, 0), (10, 0, 10, 10), (10, 10, 0, 10), (0, 10, 0, 0)):
        grid.block_line(*wall)
    return ObstacleLayer(grid)


def rays(ahead: float, farther: float = 4.9) -> list[Echo]:
    """A scan of 181 rays: the nine in the middle end at ``ahead`` m."""
    return [(ahead if abs(degrees) < 5 else farther, math.radians(degrees)) for degrees in range(-90, 91)]


def test_an_echo_beside_the_walls_marks_its_cell() -> None:
    seen = layer()
    seen.add_scan(HERE, rays(1.0), 0.0)
    points = seen.points(0.0)
    assert points and all(math.dist(point, (5.0, 6.0)) < 0.2 for point in points)


def test_echoes_of_walls_of_the_map_and_distant_ones_mark_nothing() -> None:
    seen = layer()
    seen.add_scan((5.0, 9.0, math.pi / 2), [(1.0, 0.0), (0.9, 0.0), (MARK_RANGE + 0.1, math.pi / 2)], 0.0)
    assert seen.points(0.0) == []


def test_rays_that_pass_through_clear() -> None:
    seen = layer()
    seen.add_scan(HERE, rays(1.0), 0.0)
    seen.add_scan(HERE, rays(4.9), 0.2)
    assert seen.points(0.2) == []


def test_rays_that_end_before_it_clear_nothing() -> None:
    seen = layer()
    seen.add_scan(HERE, rays(2.0), 0.0)
    far = set(seen.points(0.0))
    seen.add_scan(HERE, rays(1.0), 0.2)
    assert far < set(seen.points(0.2))


def test_a_direction_without_an_echo_proves_nothing() -> None:
    seen = layer()
    seen.add_scan(HERE, rays(1.0), 0.0)
    marked = seen.points(0.0)
    seen.add_scan(HERE, [ray for ray in rays(4.9) if abs(ray[1]) > 0.2], 0.2)
    assert seen.points(0.2) == marked


def test_marks_fade() -> None:
    seen = layer()
    seen.add_points([(5.0, 6.0)], 0.0)
    assert len(seen.points(FADE_S - 0.1)) == 1
    assert seen.points(FADE_S) == []


def test_what_stood_there_for_a_while_is_remembered_longer() -> None:
    seen = layer()
    for second in range(7):
        seen.add_points([(5.0, 6.0)], float(second))
    assert len(seen.points(6 + FADE_S)) == 1 and seen.recent_points(6 + FADE_S) == []
    assert len(seen.points(6 + STOOD_FADE_S - 0.1)) == 1
    assert seen.points(6 + STOOD_FADE_S) == []


@pytest.mark.parametrize(
    "point, curvature, free",
    [((1.0, 0.0), 0.0, 0.8), ((1.0, 0.3), 0.0, math.inf), ((-1.0, 0.0), 0.0, math.inf),
     # A quarter of a circle of 1 m to the left, and to the right.
     ((1.0, 1.0), 1.0, math.pi / 2 - 0.2), ((1.0, -1.0), -1.0, math.pi / 2 - 0.2), ((1.0, 1.0), -1.0, math.inf),
     ((1.0, 0.0), 1.0, math.inf)],
)  # fmt: skip
def test_the_free_way_along_an_arc(point: tuple[float, float], curvature: float, free: float) -> None:
    assert free_way([point], curvature, 0.2, 0.03) == pytest.approx(free)


def test_a_point_that_the_hull_touches_only_with_its_margin_ends_the_way() -> None:
    for side in (1, -1):
        assert free_way([(0.5, 0.21 * side)], 0.0, 0.2, 0.03) == pytest.approx(0.5)
        assert free_way([(0.5, 0.24 * side)], 0.0, 0.2, 0.03) == math.inf


def test_what_closes_a_path() -> None:
    path = [(0.0, 0.0), (2.0, 0.0), (2.0, 3.0)]
    assert closes_path([(1.0, 0.2)], path, 0.25, 3.0)
    assert not closes_path([(1.0, 0.3)], path, 0.25, 3.0)
    assert closes_path([(2.1, 0.8)], path, 0.25, 3.0)
    assert not closes_path([(2.1, 2.0)], path, 0.25, 3.0)


# --- what is gone -----------------------------------------------------------------------------------------------------


def hall_with_a_crate(*, fixed: bool = False) -> ObstacleLayer:
    """A hall with a crate of 0.6 m ahead, whose near side is 1 m away."""
    grid = Grid(0, 0, 10, 10, 0.1)
    for side in ((0, 0, 10, 0), (10, 0, 10, 10), (10, 10, 0, 10), (0, 10, 0, 0)):
        grid.block_line(*side)
    for wall in ((4.7, 6.0, 5.3, 6.0), (5.3, 6.0, 5.3, 6.6), (5.3, 6.6, 4.7, 6.6), (4.7, 6.6, 4.7, 6.0)):
        grid.block_line(*wall)
        if fixed:
            marks = Grid(0, 0, 10, 10, 0.1)
            marks.block_line(*wall)
            grid.fixed = bytearray(a | b for a, b in zip(grid.fixed, marks.blocked, strict=True))
    return ObstacleLayer(grid)


def look(seen: ObstacleLayer, scans: int, ahead: float = 3.9, where: Pose = HERE) -> int:
    """How many cells are gone after some scans, between which the grid is measured anew."""
    for _ in range(scans):
        angles = [math.radians(degrees) for degrees in range(-60, 61)]
        seen.pass_walls(where, [((ahead if abs(a) < 0.4 else 3.9) / math.cos(a), a) for a in angles])
        seen.grid = (seen.grid.base or seen.grid).freed(seen.gone)
    return len(seen.gone)


def test_a_crate_that_is_seen_through_is_gone_after_some_scans() -> None:
    seen = hall_with_a_crate()
    assert look(seen, GONE_AFTER - 1) == 0
    look(seen, 2 * GONE_AFTER)
    assert seen.grid.nearest(5.0, 6.3, 1.0).distance > 0.29
    # The walls of the hall stay.
    assert seen.grid.nearest(5.0, 9.5, 1.0).distance == pytest.approx(0.5)


def test_a_crate_that_is_seen_again_is_there_again() -> None:
    seen = hall_with_a_crate()
    # From two sides: a ray along a side of the crate does not pass through it.
    for where in (HERE, (3.7, 6.3, 0.0), HERE):
        look(seen, 2 * GONE_AFTER, where=where)
    assert seen.grid.nearest(5.0, 5.5, 1.0).distance > 0.6
    look(seen, 4, ahead=1.0)
    assert seen.grid.nearest(5.0, 5.5, 1.0).distance == pytest.approx(0.5)


def test_what_is_forbidden_does_not_go() -> None:
    assert look(hall_with_a_crate(fixed=True), 3 * GONE_AFTER) == 0


@pytest.mark.parametrize("beside", [-0.05, 0.0, 0.05])
def test_a_wall_along_which_the_robot_looks_does_not_go(beside: float) -> None:
    grid = Grid(0, 0, 10, 10, 0.1)
    for wall in ((0, 0, 10, 0), (10, 0, 10, 10), (10, 10, 0, 10), (0, 10, 0, 0), (5.3, 4.0, 5.3, 9.0)):
        grid.block_line(*wall)
    seen = ObstacleLayer(grid)
    # What it sees is right, and where it believes to be is 5 cm off.
    scan = [(min(4.9, 0.3 / math.sin(-a)) if a < 0 else 4.9, a) for a in map(math.radians, range(-90, 91))]
    for _ in range(3 * GONE_AFTER):
        seen.pass_walls((5.0 + beside, 5.0, math.pi / 2), scan)
    assert not seen.gone
