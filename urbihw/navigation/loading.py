"""Reads the map of the navigator, and makes its grids."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from urbihw.navigation.grid import Grid
from urbihw.navigation.localize import CELL
from urbihw.navigation.maps import BadMap, Bounds, Map, check_name, read

MAX_BOXES: Final = 2000
"""Maximum number of boxes that tell the walls."""
_RUN: Final = re.compile(rb"[^\0]+")


def check_map(name: str) -> None:
    """Raise ValueError for a map that cannot be one; what is in the file is checked in a thread."""
    try:
        check_name(name)
    except BadMap as error:
        raise ValueError(str(error)) from error


def load_map(name: str, cell: float, *, scans: bool) -> tuple[Map, Grid, Grid, list[Bounds]]:
    """Read a map, and make its grids for paths and for scans (the same one without scans), and its walls for who draws
    it.  Raises BadMap."""
    map_ = read(name)
    grid = Grid.of(map_, cell)
    walls = Grid.seen(map_, CELL) if scans else grid
    for measured in (grid, walls):
        measured.distances()
    return map_, grid, walls, wall_boxes(grid)


def wall_boxes(grid: Grid) -> list[Bounds]:
    """The occupied cells of a grid as few boxes, m; a map of many specks as coarser ones."""
    size, boxes = 1, _boxes(grid, 1)
    while len(boxes) > MAX_BOXES:
        size *= 2
        boxes = _boxes(grid, size)
    return boxes


def _boxes(grid: Grid, size: int) -> list[Bounds]:
    """Boxes of blocks of ``size`` cells squared that are not free: the runs of a row, over the rows that are alike."""
    begun: dict[tuple[int, int], int] = {}
    boxes = []
    for row in range(0, grid.height + size, size):
        runs = set(_runs(grid, row, size))
        for run in [run for run in begun if run not in runs]:
            boxes.append(_box(grid, run, begun.pop(run), row))
        for run in runs:
            begun.setdefault(run, row)
    return boxes


def _runs(grid: Grid, row: int, size: int) -> Iterator[tuple[int, int]]:
    """First column and end of each run of blocks that are not free, in some rows."""
    joined = 0
    for each in range(row, min(row + size, grid.height)):
        joined |= int.from_bytes(grid.blocked[each * grid.width : (each + 1) * grid.width], "little")
    cells = joined.to_bytes(grid.width, "little")
    blocks = bytes(any(cells[column : column + size]) for column in range(0, grid.width, size))
    for match in _RUN.finditer(blocks):
        yield match.start() * size, min(match.end() * size, grid.width)


def _box(grid: Grid, run: tuple[int, int], first: int, end: int) -> Bounds:
    cell, last = grid.cell, min(end, grid.height)
    left, right = grid.left + run[0] * cell, grid.left + run[1] * cell
    return round(left, 3), round(grid.bottom + first * cell, 3), round(right, 3), round(grid.bottom + last * cell, 3)
