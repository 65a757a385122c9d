"""A map as a grid of cells, with the distance of each cell to the nearest wall."""

from __future__ import annotations

import math
from typing import Final

from urbihw.navigation.extra import load_arrays
from urbihw.navigation.maps import Map

MARGIN: Final = 0.5
"""Width in m of the free cells around a map."""
MAX_CELLS: Final = 160_000
"""Maximum number of cells; larger maps get larger cells.  Planning takes about 0.5 us per cell, without the extra
``navigation`` about 10 us and 0.6 kB."""

_STRAIGHT, _DIAGONAL = 1.0, math.sqrt(2)
_FAR: Final = 1e9


class Grid:
    """The cells of a map.

    Attributes:
        cell: size of a cell in m.
        width, height: numbers of columns and rows.
        bounds: left, bottom, right, top of the map in m, without the margin.
        blocked: 1 for each cell that is occupied, row by row from the bottom.
    """

    def __init__(self, left: float, bottom: float, right: float, top: float, cell: float) -> None:
        self.bounds = left, bottom, right, top
        wide, high = right - left + 2 * MARGIN, top - bottom + 2 * MARGIN
        self.cell = max(cell, math.sqrt(wide * high / MAX_CELLS))
        # Shifted by half a cell, so that walls at round numbers lie in the middle of cells and not on their borders.
        self.left, self.bottom = left - MARGIN - self.cell / 2, bottom - MARGIN - self.cell / 2
        self.width, self.height = math.ceil(wide / self.cell), math.ceil(high / self.cell)
        self.blocked = bytearray(self.width * self.height)
        self._distances: list[float] | None = None

    @classmethod
    def of(cls, map_: Map, cell: float) -> Grid:
        """The cells of a map."""
        grid = cls(*map_.bounds, max(cell, map_.fine))
        map_.draw(grid)
        return grid

    def copy(self) -> Grid:
        """A copy, to which walls can be added."""
        made = object.__new__(Grid)
        made.__dict__.update(self.__dict__)
        made.blocked = bytearray(self.blocked)
        made._distances = None
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
        """Mark the cell of a point as occupied."""
        column, row = self.column_row(x, y)
        if self.holds(column, row):
            self.blocked[row * self.width + column] = 1

    def block_line(self, x1: float, y1: float, x2: float, y2: float) -> None:
        """Block the cells along a line: points half a cell apart, so that none is passed over."""
        steps = max(1, math.ceil(math.hypot(x2 - x1, y2 - y1) / self.cell * 2))
        for step in range(steps + 1):
            self.block(x1 + (x2 - x1) * step / steps, y1 + (y2 - y1) * step / steps)

    def block_box(self, left: float, bottom: float, right: float, top: float) -> None:
        """Block every cell that the box overlaps."""
        first_column, first_row = self.column_row(left, bottom)
        # A box that ends where a cell begins does not touch it.
        last_column, last_row = self.column_row(max(left, right - 1e-9), max(bottom, top - 1e-9))
        first_column, last_column = max(first_column, 0), min(last_column, self.width - 1)
        if first_column > last_column:
            return
        full = b"\1" * (last_column - first_column + 1)
        for row in range(max(first_row, 0), min(last_row, self.height - 1) + 1):
            start = row * self.width
            self.blocked[start + first_column : start + last_column + 1] = full

    # ---------------------------------------------------------------- how far

    def distances(self) -> list[float]:
        """Distance in m from each cell to the nearest occupied one, exact, or without the extra
        ``navigation`` within 8 percent."""
        if self._distances is None:
            self._distances = self._measure()
        return self._distances

    def distance(self, x: float, y: float) -> float:
        """Distance in m from a point to the nearest occupied cell; inf outside of the grid."""
        column, row = self.column_row(x, y)
        return self.distances()[row * self.width + column] if self.holds(column, row) else math.inf

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
