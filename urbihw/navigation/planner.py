"""Paths on a grid: the cheapest way over its cells, then as few corners as the walls allow.

A cell can be passed if the middle of the robot has enough room at some place in it, measured from the walls where they
are and not from their cells: so a corridor that is a little wider than the robot is a way, however it lies to the grid.
Two distances to walls count.  Ways keep the ``clear`` one where they can; only if no such way leads to the goal may a
part of the way be as narrow as ``least``, and there it leads through the middle.

With the extra ``navigation`` (numpy, scipy) the way comes from scipy's Dijkstra; without it from A* of the package
``pathfinding``, the extra ``planner``, which is pure Python and ten to a hundred times as slow.  Both run in a thread
(``bench/navigation.py``).
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from typing import Any, Final

from urbihw.frozen import frozen
from urbihw.navigation.extra import how_to_install, load_arrays
from urbihw.navigation.frames import Point
from urbihw.navigation.grid import Grid
from urbihw.navigation.standing import Standing, measure_standing

MAX_DETOUR_TO_FREE: Final = 0.6
"""Maximum distance in m to a free cell when the start is too near to a wall."""
MAX_REPAIRS: Final = 30
"""Maximum number of searches, each without the cells between which the one before touched a wall."""
LOSS: Final = 0.002
"""m that a straight line may be nearer to a wall than the corners that it replaces."""


class NoPath(Exception):
    """There is no path; the message gives the reason."""


class Obstructed(NoPath):
    """The map has a path, but obstacles that the sensors see close it."""


@frozen
class Room:
    """The distances in m that paths keep, from the middle of the robot: ``clear`` to walls and to obstacles, and
    ``least`` to walls of the map where there is no other way."""

    clear: float
    least: float


def check_goal(grid: Grid, goal: Point, clearance: float) -> None:
    """Raises NoPath for a goal at which the robot cannot stand with ``clearance`` m to the walls of the map."""
    left, bottom, right, top = grid.bounds
    if not (left <= goal[0] <= right and bottom <= goal[1] <= top):
        raise NoPath(
            f"the goal ({goal[0]:g}, {goal[1]:g}) is outside the map, "
            f"which goes from ({left:g}, {bottom:g}) to ({right:g}, {top:g}) m"
        )
    if grid.distance(*goal) == 0:
        raise NoPath(f"the goal ({goal[0]:g}, {goal[1]:g}) is in a wall; choose a free place")
    distance = grid.nearest(*goal, clearance).distance
    if distance < clearance:
        raise NoPath(
            f"the goal ({goal[0]:g}, {goal[1]:g}) is {distance:.2f} m from a wall, and the robot needs "
            f"{clearance:.2f} m; choose another, or a smaller clearance in the settings"
        )


def plan_around(grid: Grid, seen: Sequence[Point], start: Point, goal: Point, room: Room) -> list[Point]:
    """A path as that of ``plan``, around the walls of the map and the points that sensors see.  Raises NoPath, and
    Obstructed if only these points close the way."""
    try:
        return plan(grid, start, goal, room, seen)
    except NoPath as error:
        if not seen:
            raise
        plan(grid, start, goal, room)
        raise Obstructed("obstacles that the sensors see close the way") from error


def plan(grid: Grid, start: Point, goal: Point, room: Room, seen: Sequence[Point] = ()) -> list[Point]:
    """The corners of a path from start to goal.  Raises NoPath.

    It begins at the start and ends at the goal; if the start is nearer to a wall than that, the path first leads away
    from the wall.
    """
    check_goal(grid, goal, room.clear)
    try:
        return _plan(standing_on(grid, room.clear, room.clear).around(seen), start, goal)
    except NoPath:
        if room.least >= room.clear:
            raise
    return _plan(standing_on(grid, room.clear, room.least).around(seen), start, goal)


def standing_on(grid: Grid, clear: float, least: float) -> Standing:
    """Where the robot may be on a grid; it is measured once."""
    known = grid.standings.get((clear, least))
    if known is None:
        before = standing_on(grid.base, clear, least) if grid.base is not None else None
        known = grid.standings[clear, least] = measure_standing(grid, clear, least, before)
    return known


def _plan(standing: Standing, start: Point, goal: Point) -> list[Point]:
    grid, costs = standing.grid, standing.costs
    first, last = _free_cell(standing, start), grid.column_row(*goal)
    if all(math.dist(goal, point) >= standing.clear for point in standing.seen):
        # The robot can stand there, whatever another place of its cell is like.
        costs[last[1] * grid.width + last[0]] = max(1, costs[last[1] * grid.width + last[0]])
    for _ in range(MAX_REPAIRS):
        cells = _search(grid, costs, first, last)
        if not cells:
            break
        points = [start, *(standing.spot(cell) for cell in cells[1:-1]), goal]
        touching = _touching(standing, cells, points) if standing.is_tight else []
        if not touching:
            return _straightened(standing, points)
        for column, row in touching:
            costs[row * grid.width + column] = 0
    raise NoPath(f"no way leads there that is {2 * standing.least:.2f} m wide, as this robot needs")


def _touching(standing: Standing, cells: list[tuple[int, int]], points: list[Point]) -> list[tuple[int, int]]:
    """The cells from which the way to the next one is too near to a wall; from the start the robot must get away."""
    return [
        cells[number] for number in range(1, len(cells) - 1)
        if not standing.is_clear(points[number], points[number + 1], standing.least - LOSS)
    ]  # fmt: skip


def _free_cell(standing: Standing, place: Point) -> tuple[int, int]:
    """The cell with enough room that is nearest to the robot.  Raises NoPath."""
    grid = standing.grid
    column, row = grid.column_row(*place)
    if not grid.holds(column, row):
        raise NoPath("the robot is outside the map")
    costs, reach = standing.costs, math.ceil(MAX_DETOUR_TO_FREE / grid.cell)
    found = [
        (math.hypot(c - column, r - row), c, r)
        for r in range(max(0, row - reach), min(grid.height, row + reach + 1))
        for c in range(max(0, column - reach), min(grid.width, column + reach + 1))
        if costs[r * grid.width + c]
    ]
    if not found:
        raise NoPath("the robot is in a wall or too near one")
    _, c, r = min(found)
    return c, r


def _search(grid: Grid, costs: list[int], first: tuple[int, int], last: tuple[int, int]) -> list[tuple[int, int]]:
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


def _straightened(standing: Standing, points: list[Point]) -> list[Point]:
    """Remove the corners that a straight line makes unnecessary; it keeps the room that the corners had."""
    rooms = [standing.room(point) for point in points] if standing.is_tight else [standing.clear] * len(points)
    kept = [points[0]]
    at = 0
    while at < len(points) - 1:
        next_ = len(points) - 1
        while next_ > at + 1:
            room = max(standing.least, min(rooms[at + 1 : next_ + 1]) - LOSS)
            if standing.is_clear(points[at], points[next_], room):
                break
            next_ = at + max(1, (next_ - at) // 2)
        kept.append(points[next_])
        at = next_
    return kept
