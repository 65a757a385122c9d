"""A map as a grid of cells, with the distance of each cell to the nearest wall.

A cell is occupied or free; beside that the grid keeps where in a cell its walls were measured, so that the distance of
a point to the nearest wall does not depend on how the walls lie to the cells.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any, Final, NamedTuple

from urbihw.navigation.extra import load_arrays
from urbihw.navigation.maps import Bounds, Map, Segment

MARGIN: Final = 0.5
"""Width in m of the free cells around a map."""
MAX_CELLS: Final = 160_000
"""Maximum number of cells; larger maps get larger cells.  Planning takes about 0.5 us per cell, without the extra
``navigation`` about 10 us and 0.6 kB."""

_STRAIGHT, _DIAGONAL = 1.0, math.sqrt(2)
_FAR: Final = 1e9
_SWEEP_ERROR: Final = 1.09
"""Ratio of a distance to the exact one, at most, without the extra."""


class Nearest(NamedTuple):
    """The nearest wall of a point: its distance in m, and where it is."""

    distance: float
    x: float = math.nan
    y: float = math.nan


class Grid:
    """The cells of a map.

    Attributes:
        cell: size of a cell in m.
        width, height: numbers of columns and rows.
        bounds: left, bottom, right, top of the map in m, without the margin.
        blocked: 1 for each cell that is occupied, row by row from the bottom.
        fixed: 1 for each cell that no scan can free.
        base: the grid of the map, if some of its cells have been freed.
        standings: what the planner remembers of it, of a map that does not change.
    """

    def __init__(self, left: float, bottom: float, right: float, top: float, cell: float) -> None:
        self.bounds = left, bottom, right, top
        wide, high = right - left + 2 * MARGIN, top - bottom + 2 * MARGIN
        self.cell = max(cell, math.sqrt(wide * high / MAX_CELLS))
        # Shifted by half a cell, so that walls at round numbers lie in the middle of cells and not on their borders.
        self.left, self.bottom = left - MARGIN - self.cell / 2, bottom - MARGIN - self.cell / 2
        self.width, self.height = math.ceil(wide / self.cell), math.ceil(high / self.cell)
        self.blocked = bytearray(self.width * self.height)
        self.fixed = bytearray(self.width * self.height)
        self.base: Grid | None = None
        self._lines: dict[int, tuple[Segment, ...]] = {}
        self._boxes: dict[int, Bounds] = {}
        """The walls in cells that are not occupied as a whole: pieces of lines, and a box around all else."""
        self._distances: list[float] | None = None
        self.standings: dict[tuple[float, float], Any] = {}

    @classmethod
    def of(cls, map_: Map, cell: float) -> Grid:
        """The cells of a map."""
        grid, fixed = (cls(*map_.bounds, max(cell, map_.fine)) for _ in range(2))
        map_.draw(grid)
        map_.draw_fixed(fixed)
        grid.fixed = fixed.blocked
        return grid

    @classmethod
    def seen(cls, map_: Map, cell: float) -> Grid:
        """The cells of a map with only what a laser sees."""
        grid = cls(*map_.bounds, max(cell, map_.fine))
        map_.draw_seen(grid)
        return grid

    def freed(self, cells: Iterable[int]) -> Grid:
        """A copy in which some cells, by their index in ``blocked``, are free; its distances are measured."""
        made = object.__new__(Grid)
        made.__dict__.update(self.__dict__)
        made.blocked = bytearray(self.blocked)
        for index in cells:
            made.blocked[index] = 0
        made._distances, made.standings, made.base = None, {}, self
        made.distances()
        return made

    # ---------------------------------------------------------------- where

    def column_row(self, x: float, y: float) -> tuple[int, int]:
        """The cell of a point, which may lie outside of the grid."""
        return math.floor((x - self.left) / self.cell), math.floor((y - self.bottom) / self.cell)

    def middle(self, column: int, row: int) -> tuple[float, float]:
        """The middle of a cell, in m."""
        return self.left + (column + 0.5) * self.cell, self.bottom + (row + 0.5) * self.cell

    def holds(self, column: int, row: int) -> bool:
        """Whether the grid has this cell."""
        return 0 <= column < self.width and 0 <= row < self.height

    # ---------------------------------------------------------------- what is in the way

    def block(self, x: float, y: float) -> None:
        """Mark a point as occupied."""
        column, row = self.column_row(x, y)
        if self.holds(column, row):
            self._add_box(row * self.width + column, (x, y, x, y))

    def block_line(self, x1: float, y1: float, x2: float, y2: float) -> None:
        """Mark a line as occupied: a piece of it in each cell through which it goes."""
        dx, dy = x2 - x1, y2 - y1
        cuts = sorted({0.0, 1.0, *self._cuts(x1 - self.left, dx), *self._cuts(y1 - self.bottom, dy)})
        for a, b in zip(cuts, cuts[1:], strict=False):
            column, row = self.column_row(x1 + dx * (a + b) / 2, y1 + dy * (a + b) / 2)
            if self.holds(column, row):
                self._add_line(row * self.width + column, (x1 + dx * a, y1 + dy * a, x1 + dx * b, y1 + dy * b))

    def _cuts(self, start: float, way: float) -> Iterator[float]:
        """The shares of a way along an axis at which it goes into another cell."""
        if way:
            low, high = sorted((start, start + way))
            for border in range(math.floor(low / self.cell) + 1, math.ceil(high / self.cell)):
                yield (border * self.cell - start) / way

    def block_box(self, left: float, bottom: float, right: float, top: float) -> None:
        """Mark a box as occupied."""
        first_column, first_row = self.column_row(left, bottom)
        # A box that ends where a cell begins does not touch it.
        last_column, last_row = self.column_row(max(left, right - 1e-9), max(bottom, top - 1e-9))
        cell = self.cell
        for row in range(max(first_row, 0), min(last_row, self.height - 1) + 1):
            low = self.bottom + row * cell
            part_bottom, part_top = max(bottom, low), min(top, low + cell)
            for column in range(max(first_column, 0), min(last_column, self.width - 1) + 1):
                at = self.left + column * cell
                self._add_box(row * self.width + column, (max(left, at), part_bottom, min(right, at + cell), part_top))

    def _is_full(self, index: int) -> bool:
        return bool(self.blocked[index]) and index not in self._boxes and index not in self._lines

    def _add_line(self, index: int, piece: Segment) -> None:
        if not self._is_full(index):
            self.blocked[index] = 1
            self._lines[index] = (*self._lines.get(index, ()), piece)

    def _add_box(self, index: int, box: Bounds) -> None:
        if self._is_full(index):
            return
        self.blocked[index] = 1
        if old := self._boxes.get(index):
            box = min(old[0], box[0]), min(old[1], box[1]), max(old[2], box[2]), max(old[3], box[3])
        if min(box[2] - box[0], box[3] - box[1]) >= self.cell * (1 - 1e-6):
            self._boxes.pop(index, None)
            self._lines.pop(index, None)
        else:
            self._boxes[index] = box

    # ---------------------------------------------------------------- how far

    def distances(self) -> list[float]:
        """Distance in m from each cell to the nearest occupied one, exact, or without the extra
        ``navigation`` within 8 percent."""
        if self._distances is None:
            self._distances = self._measure()
        return self._distances

    def distance(self, x: float, y: float) -> float:
        """Distance in m between the middles of the cell of a point and of the nearest occupied one; inf outside of the
        grid."""
        column, row = self.column_row(x, y)
        return self.distances()[row * self.width + column] if self.holds(column, row) else math.inf

    def nearest(self, x: float, y: float, most: float) -> Nearest:
        """The wall nearest to a point where it was measured; one that is ``most`` m away if there is none nearer."""
        column, row = self.column_row(x, y)
        best, cell, width = Nearest(most), self.cell, self.width
        if not self.holds(column, row):
            return best
        between = self.distances()[row * width + column]
        slack = math.sqrt(2) * cell
        if between / _SWEEP_ERROR - slack >= most:
            return best
        reach = min(most, between + slack)
        columns, rows = self.column_row(x - reach, y - reach), self.column_row(x + reach, y + reach)
        first, last = max(0, columns[0]), min(width - 1, rows[0])
        for each in range(max(0, columns[1]), min(self.height - 1, rows[1]) + 1):
            end = each * width + last + 1
            at = self.blocked.find(1, each * width + first, end)
            while at >= 0:
                best = self._nearest_in(at, x, y, best)
                at = self.blocked.find(1, at + 1, end)
        return best

    def _nearest_in(self, index: int, x: float, y: float, best: Nearest) -> Nearest:
        """The nearer one of a wall and of those in a cell."""
        lines = self._lines.get(index)
        box = self._boxes.get(index)
        if box is None and lines is None:
            left, bottom = self.left + index % self.width * self.cell, self.bottom + index // self.width * self.cell
            box = left, bottom, left + self.cell, bottom + self.cell
        if box is not None:
            px, py = min(max(x, box[0]), box[2]), min(max(y, box[1]), box[3])
            if (distance := math.hypot(x - px, y - py)) < best.distance:
                best = Nearest(distance, px, py)
        for x1, y1, x2, y2 in lines or ():
            dx, dy = x2 - x1, y2 - y1
            square = dx * dx + dy * dy
            share = ((x - x1) * dx + (y - y1) * dy) / square if square else 0.0
            share = 0.0 if share < 0.0 else min(share, 1.0)
            px, py = x1 + share * dx, y1 + share * dy
            if (distance := math.hypot(x - px, y - py)) < best.distance:
                best = Nearest(distance, px, py)
        return best

    def _measure(self) -> list[float]:
        if arrays := load_arrays():
            measured: list[float] = arrays.measure_distances(self.blocked, self.width, self.cell).ravel().tolist()
            return measured
        return self._sweep_distances()

    def _sweep_distances(self) -> list[float]:
        """The distances by two passes over the grid."""
        width, height = self.width, self.height
        # A border of far cells avoids all tests for the edge.
        wide = width + 2
        field = [_FAR] * (wide * (height + 2))
        for row in range(height):
            start = (row + 1) * wide + 1
            line = self.blocked[row * width : (row + 1) * width]
            field[start : start + width] = [0.0 if cell else _FAR for cell in line]
        down = ((-1, _STRAIGHT), (-wide, _STRAIGHT), (-wide - 1, _DIAGONAL), (-wide + 1, _DIAGONAL))
        _sweep(field, [row * wide + column for row in range(1, height + 1) for column in range(1, width + 1)], down)
        up = tuple((-step, cost) for step, cost in down)
        _sweep(field, [row * wide + column for row in range(height, 0, -1) for column in range(width, 0, -1)], up)
        cell = self.cell
        return [
            value * cell
            for row in range(height)
            for value in field[(row + 1) * wide + 1 : (row + 1) * wide + 1 + width]
        ]


def _sweep(field: list[float], order: list[int], steps: tuple[tuple[int, float], ...]) -> None:
    (a, near_a), (b, near_b), (c, near_c), (d, near_d) = steps
    for at in order:
        best = field[at]
        if best:
            straight = min(field[at + a] + near_a, field[at + b] + near_b)
            field[at] = min(best, straight, field[at + c] + near_c, field[at + d] + near_d)
