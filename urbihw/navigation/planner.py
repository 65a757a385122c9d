"""Paths on a grid: the cheapest way over its cells, then as few corners as the walls allow.

With the extra ``navigation`` (numpy, scipy) the way comes from scipy's Dijkstra; without it from A* of the package
``pathfinding``, the extra ``planner``, which is pure Python and ten to a hundred times as slow.  Both run in a thread
(``bench/navigation.py``).
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from typing import Any, Final

from urbihw.navigation.extra import how_to_install, load_arrays
from urbihw.navigation.frames import Point
from urbihw.navigation.grid import Grid

MAX_DETOUR_TO_FREE: Final = 0.6
"""Maximum distance in m to a free cell when the start is too near to a wall."""
_COMFORT: Final = 0.3
"""Width in m of the zone beside the clearance in which cells cost more."""
_CLOSE_COST: Final = 4


class NoPath(Exception):
    """There is no path; the message gives the reason."""


class Obstructed(NoPath):
    """The map has a path, but obstacles that the sensors see close it."""


def check_goal(grid: Grid, goal: Point, clearance: float) -> None:
    """Raises NoPath for a goal at which the robot cannot stand with ``clearance`` m to the walls of the map."""
    left, bottom, right, top = grid.bounds
    if not (left <= goal[0] <= right and bottom <= goal[1] <= top):
        raise NoPath(
            f"the goal ({goal[0]:g}, {goal[1]:g}) is outside the map, "
            f"which goes from ({left:g}, {bottom:g}) to ({right:g}, {top:g}) m"
        )
    distance = grid.distance(*goal)
    if distance == 0:
        raise NoPath(f"the goal ({goal[0]:g}, {goal[1]:g}) is in a wall; choose a free place")
    if distance < clearance:
        raise NoPath(
            f"the goal ({goal[0]:g}, {goal[1]:g}) is {distance:.2f} m from a wall, and the robot needs "
            f"{clearance:.2f} m; choose another, or a smaller clearance in the settings"
        )


def plan_around(grid: Grid, seen: Sequence[Point], start: Point, goal: Point, clearance: float) -> list[Point]:
    """A path as that of ``plan``, around the walls of the map and the points that sensors see.  Raises NoPath, and
    Obstructed if only these points close the way."""
    if not seen:
        return plan(grid, start, goal, clearance)
    both = grid.copy()
    for point in seen:
        both.block(*point)
    try:
        return plan(both, start, goal, clearance)
    except NoPath as error:
        plan(grid, start, goal, clearance)
        raise Obstructed("obstacles that the sensors see close the way") from error


def plan(grid: Grid, start: Point, goal: Point, clearance: float) -> list[Point]:
    """The corners of a path from start to goal that keeps ``clearance`` m from walls.  Raises NoPath.

    It begins at the start and ends at the goal; if the start is nearer to a wall than that, the path first leads away
    from the wall.
    """
    check_goal(grid, goal, clearance)
    first, last = _free_cell(grid, start, clearance), grid.column_row(*goal)
    cells = _search(grid, first, last, clearance)
    if not cells:
        raise NoPath("no way leads there that is wide enough for the robot")
    return _straightened(grid, [start, *(grid.middle(*cell) for cell in cells[1:-1]), goal], clearance)


def _free_cell(grid: Grid, place: Point, clearance: float) -> tuple[int, int]:
    """The cell with enough clearance that is nearest to the robot.  Raises NoPath."""
    column, row = grid.column_row(*place)
    if not grid.holds(column, row):
        raise NoPath("the robot is outside the map")
    distances, reach = grid.distances(), math.ceil(MAX_DETOUR_TO_FREE / grid.cell)
    found = [
        (math.hypot(c - column, r - row), c, r)
        for r in range(max(0, row - reach), min(grid.height, row + reach + 1))
        for c in range(max(0, column - reach), min(grid.width, column + reach + 1))
        if distances[r * grid.width + c] >= clearance
    ]
    if not found:
        raise NoPath("the robot is in a wall or too near one")
    _, c, r = min(found)
    return c, r


def _search(grid: Grid, first: tuple[int, int], last: tuple[int, int], clearance: float) -> list[tuple[int, int]]:
    comfort = clearance + _COMFORT
    costs = [0 if d < clearance else _CLOSE_COST if d < comfort else 1 for d in grid.distances()]
    if arrays := load_arrays():
        cells: list[tuple[int, int]] = arrays.find_cells(costs, grid.width, first, last)
        return cells
    return _search_slowly(grid, costs, first, last)


def _search_slowly(
    grid: Grid, costs: list[int], first: tuple[int, int], last: tuple[int, int]
) -> list[tuple[int, int]]:
    """The cells by the package ``pathfinding``.  Raises NoPath without it."""
    try:
        core: Any = importlib.import_module("pathfinding.core.grid")
        moves: Any = importlib.import_module("pathfinding.core.diagonal_movement")
        finder: Any = importlib.import_module("pathfinding.finder.a_star")
    except ImportError as error:
        raise NoPath(f"planning needs numpy and scipy: {how_to_install()}") from error
    matrix = [costs[row * grid.width : (row + 1) * grid.width] for row in range(grid.height)]
    nodes = core.Grid(matrix=matrix)
    star = finder.AStarFinder(diagonal_movement=moves.DiagonalMovement.only_when_no_obstacle)
    path, _ = star.find_path(nodes.node(*first), nodes.node(*last), nodes)
    return [(node.x, node.y) for node in path]


def _straightened(grid: Grid, points: list[Point], clearance: float) -> list[Point]:
    """Remove the corners that a straight line makes unnecessary."""
    kept = [points[0]]
    at = 0
    while at < len(points) - 1:
        next_ = len(points) - 1
        while next_ > at + 1 and not _clear(grid, points[at], points[next_], clearance):
            next_ = at + max(1, (next_ - at) // 2)
        kept.append(points[next_])
        at = next_
    return kept


def _clear(grid: Grid, a: Point, b: Point, clearance: float) -> bool:
    steps = max(1, math.ceil(math.dist(a, b) / grid.cell * 2))
    return all(
        grid.distance(a[0] + (b[0] - a[0]) * step / steps, a[1] + (b[1] - a[1]) * step / steps) >= clearance
        for step in range(steps + 1)
    )
