"""Reads the map of the navigator, and makes its grids."""

from __future__ import annotations

from urbihw.navigation.grid import Grid
from urbihw.navigation.localize import CELL
from urbihw.navigation.maps import BadMap, Map, check_name, read


def check_map(name: str) -> None:
    """Raise ValueError for a map that cannot be one; what is in the file is checked in a thread."""
    try:
        check_name(name)
    except BadMap as error:
        raise ValueError(str(error)) from error


def load_map(name: str, cell: float, *, scans: bool) -> tuple[Map, Grid, Grid]:
    """Read a map, and make its grids for paths and for scans (the same one without scans).  Raises BadMap."""
    map_ = read(name)
    grid = Grid.of(map_, cell)
    walls = Grid.of(map_, CELL) if scans else grid
    for measured in (grid, walls):
        measured.distances()
    return map_, grid, walls
