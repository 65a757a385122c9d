"""Paths on a grid: A* by the package ``pathfinding``, then as few corners as the walls allow.

``pathfinding`` is pure Python and takes 0.4 s for a grid of 200 by 200 with a wall to go around twice (0.1 s of it to
make its grid).  It runs in a thread, which delays the kernel by about 5 ms at a time (``bench/p3dx.py``), so that is
fast enough.  The package belongs to the extra ``planner``.
"""

from __future__ import annotations

import importlib
import math
from typing import Any, Final

from urbihw.navigation.frames import Point
from urbihw.navigation.grid import Grid

MAX_DETOUR_TO_FREE: Final = 0.6
"""Maximum distance in m to a free cell when the start or the goal is too near to a wall."""
_COMFORT: Final = 0.3
"""Width in m of the zone beside the clearance in which cells cost more."""
_CLOSE_COST: Final = 4


class NoPath(Exception):
    """There is no path; the message gives the reason."""


def plan(grid: Grid, start: Point, goal: Point, clearance: float) -> list[Point]:
    """The corners of a path from start to goal that keeps ``clearance`` m from walls.  Raises NoPath.

    It begins at the start and ends at the goal; if the start is nearer to a wall than that, the path first leads away
    from the wall.
    """
    first = _free_cell(grid, start, clearance, "the robot")
    last = _free_cell(grid, goal, 0.0 if _roomy(grid, goal, clearance) else clearance, "the goal")
    cells = _search(grid, first, last, clearance)
    if not cells:
        raise NoPath("no way leads there that is wide enough for the robot")
    points = [start, *(grid.middle(*cell) for cell in cells[1:-1]), grid.middle(*last)]
    if _roomy(grid, goal, clearance):
        points[-1] = goal
    return _straightened(grid, points, clearance)


def _roomy(grid: Grid, place: Point, clearance: float) -> bool:
    return math.inf > grid.distance(*place) >= clearance


def _free_cell(grid: Grid, place: Point, clearance: float, what: str) -> tuple[int, int]:
    """The nearest cell with enough clearance.  Raises NoPath."""
    column, row = grid.column_row(*place)
    if not grid.holds(column, row):
        raise NoPath(f"{what} is outside the map")
    distances, reach = grid.distances(), math.ceil(MAX_DETOUR_TO_FREE / grid.cell)
    found = [
        (math.hypot(c - column, r - row), c, r)
        for r in range(max(0, row - reach), min(grid.height, row + reach + 1))
        for c in range(max(0, column - reach), min(grid.width, column + reach + 1))
        if distances[r * grid.width + c] >= clearance
    ]
    if not found:
        raise NoPath(f"{what} is in a wall or too near one")
    _, c, r = min(found)
    return c, r


def _search(grid: Grid, first: tuple[int, int], last: tuple[int, int], clearance: float) -> list[tuple[int, int]]:
    try:
        core: Any = importlib.import_module("pathfinding.core.grid")
        moves: Any = importlib.import_module("pathfinding.core.diagonal_movement")
        finder: Any = importlib.import_module("pathfinding.finder.a_star")
    except ImportError as error:
        raise NoPath("planning needs the package pathfinding: pip install 'urbihw[planner]'") from error
    comfort = clearance + _COMFORT
    costs = [0 if d < clearance else _CLOSE_COST if d < comfort else 1 for d in grid.distances()]
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
