"""Where the middle of a round robot may be on a grid: the cost of each cell, and the best place in it; no I/O."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from urbihw.frozen import frozen
from urbihw.navigation.frames import Point, distance_to_line
from urbihw.navigation.grid import Grid

COMFORT: Final = 0.3
"""Width in m of the zone beside the clearance in which cells cost more."""
CLOSE_COST, TIGHT_COST = 4, 20
"""Costs of a step in that zone, and of one nearer to a wall than the clearance; elsewhere it costs 1."""
STRIDE, LONGEST_STRIDE = 0.03, 0.3
"""m by which ``is_clear`` advances at least, on which a wall comes less than 1 mm nearer, and at most."""
_HALF_DIAGONAL: Final = math.sqrt(0.5)


@frozen(slots=False)
class Standing:
    """Where the robot may be.

    Attributes:
        clear, least: distances in m from its middle to walls that it wants, and that it needs.
        costs: of one step in each cell, 0 for a closed one.
        spots: for some cells, by their index, the place in it with the most room; for the others it is the middle.
        seen: obstacles beside the walls, to which it keeps ``clear``.
    """

    grid: Grid
    clear: float
    least: float
    costs: list[int]
    spots: dict[int, Point]
    seen: Sequence[Point] = ()

    @property
    def is_tight(self) -> bool:
        """Whether the robot may be nearer to walls than it wants."""
        return self.least < self.clear

    def around(self, seen: Sequence[Point]) -> Standing:
        """The same, around obstacles that sensors see."""
        grid, costs = self.grid, list(self.costs)
        reach = math.ceil((self.clear + COMFORT) / grid.cell)
        for x, y in seen:
            column, row = grid.column_row(x, y)
            for r in range(max(0, row - reach), min(grid.height, row + reach + 1)):
                for c in range(max(0, column - reach), min(grid.width, column + reach + 1)):
                    index = r * grid.width + c
                    if costs[index]:
                        distance = math.dist(self.spot((c, r)), (x, y))
                        if distance < self.clear:
                            costs[index] = 0
                        elif distance < self.clear + COMFORT:
                            costs[index] = max(costs[index], CLOSE_COST)
        return replace(self, costs=costs, seen=seen)

    def spot(self, cell: tuple[int, int]) -> Point:
        """The place in a cell, by its column and row, at which the robot has the most room."""
        column, row = cell
        return self.spots.get(row * self.grid.width + column) or self.grid.middle(column, row)

    def room(self, point: Point) -> float:
        """Distance in m from a point to the nearest wall; ``clear`` if that is more."""
        return self.grid.nearest(*point, self.clear).distance

    def is_clear(self, a: Point, b: Point, room: float) -> bool:
        """Whether the middle of the robot can go straight from a to b with ``room`` m to walls, and ``clear`` to what
        the sensors see."""
        if any(distance_to_line(point, a, b) < self.clear for point in self.seen):
            return False
        return is_clear(self.grid, a, b, room)


def is_clear(grid: Grid, a: Point, b: Point, room: float) -> bool:
    """Whether a line keeps ``room`` m from all walls of a grid."""
    length, way = math.dist(a, b), 0.0
    while True:
        share = way / length if length else 0.0
        x, y = a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share
        free = grid.nearest(x, y, room + LONGEST_STRIDE).distance - room
        if free < 0:
            return False
        if way >= length:
            return True
        way = min(length, way + max(free, STRIDE))


def measure_standing(grid: Grid, clear: float, least: float, before: Standing | None) -> Standing:
    """Where a robot may be on a grid that wants and needs such distances to walls, in m; ``before`` is that of the same
    grid with more walls, if it is known."""
    # In its cell a wall may lie half a diagonal away from the middle, and the robot, too.
    slack = _HALF_DIAGONAL * grid.cell
    open_, closed, distances = clear + slack, least - 2 * slack, grid.distances()
    costs = [0 if d < closed else CLOSE_COST if d < clear + COMFORT else 1 for d in distances]
    spots = {}
    old = before.grid.distances() if before is not None else None
    for index, d in enumerate(distances):
        if closed <= d < open_:
            if old is not None and before is not None and old[index] == d:
                costs[index] = before.costs[index]
                if index in before.spots:
                    spots[index] = before.spots[index]
                continue
            spot, room = _best_spot(grid, grid.middle(index % grid.width, index // grid.width), clear)
            costs[index] = CLOSE_COST if room >= clear else TIGHT_COST if room >= least else 0
            if costs[index]:
                spots[index] = spot
    return Standing(grid, clear, least, costs, spots)


def _best_spot(grid: Grid, middle: Point, wanted: float) -> tuple[Point, float]:
    """The place in a cell with the most room, and that room in m; the middle if it has as much as is wanted.

    It lies away from the nearest wall, up to where another one is as near: in a corridor, half way between its walls.
    """
    room, x, y = grid.nearest(*middle, wanted)
    if room >= wanted or room == 0:
        return middle, room
    dx, dy = (middle[0] - x) / room, (middle[1] - y) / room
    most = grid.cell / 2 / max(abs(dx), abs(dy))
    there = grid.nearest(middle[0] + dx * most, middle[1] + dy * most, wanted + most).distance
    way = max(0.0, min(most, (there + most - room) / 2))
    spot = middle[0] + dx * way, middle[1] + dy * way
    best = grid.nearest(*spot, wanted).distance
    return (spot, best) if best > room else (middle, room)
