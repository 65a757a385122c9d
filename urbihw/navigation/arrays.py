"""Grids as arrays of numpy and scipy, the extra ``navigation``: distances to walls, and shortest ways over cells.

This module and those that import it are loaded only through ``extra.load_arrays``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

Floats = NDArray[np.floating[Any]]

_NO_CELL = -9999
"""scipy's predecessor of a cell that cannot be reached."""
_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Rows and columns to half of the neighbours; the graph is undirected."""


def measure_distances(blocked: bytes | bytearray, width: int, cell: float) -> Floats:
    """Distance in m from each cell to the nearest occupied one, exact; inf if none is occupied."""
    free = np.frombuffer(bytes(blocked), np.uint8).reshape(-1, width) == 0
    if free.all():
        return np.full(free.shape, math.inf)
    measured: Floats = distance_transform_edt(free) * cell
    return measured


def find_cells(costs: list[int], width: int, first: tuple[int, int], last: tuple[int, int]) -> list[tuple[int, int]]:
    """The cells (column, row) of the cheapest way between two cells by Dijkstra's algorithm; [] if there is none.

    ``costs`` has the cost of one step in each cell, 0 for a closed one.  A diagonal step needs both cells beside it.
    """
    table = np.array(costs, np.float32).reshape(-1, width)
    open_ = table > 0
    height = table.shape[0]
    number = np.arange(width * height).reshape(height, width)
    starts, ends, prices = [], [], []
    for down, right in _STEPS:
        a = (slice(0, height - down), slice(max(0, -right), width - max(0, right)))
        b = (slice(down, height), slice(max(0, right), width + min(0, right)))
        joined = open_[a] & open_[b]
        if down and right:
            joined &= open_[a[0], b[1]] & open_[b[0], a[1]]
        starts.append(number[a][joined])
        ends.append(number[b][joined])
        prices.append(((table[a] + table[b]) * (math.hypot(down, right) / 2))[joined])
    size = width * height
    graph = csr_matrix((np.concatenate(prices), (np.concatenate(starts), np.concatenate(ends))), shape=(size, size))
    begin, at = first[1] * width + first[0], last[1] * width + last[0]
    _, before = dijkstra(graph, directed=False, indices=begin, return_predecessors=True)
    if begin != at and before[at] == _NO_CELL:
        return []
    cells = [at]
    while cells[-1] != begin:
        cells.append(int(before[cells[-1]]))
    return [(index % width, index // width) for index in reversed(cells)]
