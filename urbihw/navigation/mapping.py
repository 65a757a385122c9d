"""Builds an occupancy grid from laser scans; numpy and scipy, no I/O but ``save``.

Each scan is matched with the map so far: correlative scan matching (Olson: Real-Time Correlative Scan Matching, ICRA
2009), which tries all poses of a window, first coarse, then fine, in a likelihood field of the map.  Then it is added
to a grid of log odds (Thrun, Burgard, Fox: Probabilistic Robotics, 2005, tables 9.1 and 9.2).  There is no closing of
loops: on a long round tour the drift of the matching stays in the map.
"""

from __future__ import annotations

import math
import re
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from urbihw.files import write_regular
from urbihw.navigation.base import Echo
from urbihw.navigation.frames import Pose

CELL: Final = 0.05
SIZE: Final = 60.0
"""Size in m of a cell, and of the map, in whose middle it begins."""
_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
"""The names that can be written into a YAML file without quotes."""
MAX_RANGE: Final = 12.0
"""Distance in m up to which echoes are used."""
HIT, MISS, LIMIT = 0.85, -0.4, 6.0
"""Log odds that a ray adds where it ends and where it passes, and the most that a cell keeps."""
OCCUPIED, FREE = 0.8, -0.8
"""Log odds above which a cell counts as a wall, and below which as free."""
SIGMA: Final = 0.1
"""Standard deviation in m of an echo from a wall of the map."""
BEAMS: Final = 120
"""Number of readings used for matching."""
COARSE = (0.3, 0.05, math.radians(10), math.radians(1))
FINE = (0.05, 0.01, math.radians(1), math.radians(0.2))
"""Half width and step of the search, in m and in rad."""
KEEP_GUESS: Final = 0.02
"""What a candidate at the edge of the window loses, so that the guess wins among equals (along a corridor)."""
MIN_SCORE: Final = 0.3
"""Mean likelihood below which the guess is kept: the scan shows mostly new things."""

_Floats = NDArray[np.floating[Any]]


class MapBuilder:
    """A map that grows with each scan."""

    def __init__(self, start: Pose) -> None:
        """The map lies around ``start``."""
        count = round(SIZE / CELL)
        self._odds = np.zeros((count, count), np.float32)
        self._left, self._bottom = start[0] - SIZE / 2, start[1] - SIZE / 2
        self._start = start
        self._lock = threading.Lock()
        self._is_empty = True

    def add_scan(self, guess: Pose, echoes: Sequence[Echo], place: float) -> Pose:
        """Add a scan of a laser ``place`` m ahead of the robot's middle; returns the pose that it was taken at."""
        table = np.array([(r, a) for r, a in echoes if r <= MAX_RANGE]).reshape(-1, 2)
        if not len(table):
            return guess
        local = np.stack((place + table[:, 0] * np.cos(table[:, 1]), table[:, 0] * np.sin(table[:, 1])), axis=1)
        with self._lock:
            pose = guess if self._is_empty else self._match(guess, local[:: max(1, len(local) // BEAMS)])
            self._draw(pose, local, place)
            self._is_empty = False
        return pose

    # ---------------------------------------------------------------- matching

    def _match(self, guess: Pose, local: _Floats) -> Pose:
        reach = float(np.hypot(*local.T).max()) + COARSE[0] + 1.0
        column, row = self._cells(guess[0], guess[1])
        half = math.ceil(reach / CELL)
        top, right = (int(c) - half for c in (row, column))
        first_row, first_column = max(0, top), max(0, right)
        window = self._odds[first_row : int(row) + half, first_column : int(column) + half] > OCCUPIED
        if not window.any():
            return guess
        distances = distance_transform_edt(~window) * CELL
        field = np.pad(np.exp(-(distances**2) / (2 * SIGMA**2)), 1)
        origin = (self._left + first_column * CELL, self._bottom + first_row * CELL)
        pose, score = guess, 0.0
        for step in (COARSE, FINE):
            pose, score = _best_pose(field, origin, pose, local, step)
        return pose if score >= MIN_SCORE else guess

    # ---------------------------------------------------------------- drawing

    def _cells(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Column and row of a point."""
        return np.floor((x - self._left) / CELL), np.floor((y - self._bottom) / CELL)

    def _draw(self, pose: Pose, local: _Floats, place: float) -> None:
        x, y, heading = pose
        c, s = math.cos(heading), math.sin(heading)
        from_x, from_y = x + c * place, y + s * place
        ends = np.stack((x + c * local[:, 0] - s * local[:, 1], y + s * local[:, 0] + c * local[:, 1]), axis=1)
        longest = float(np.hypot(ends[:, 0] - from_x, ends[:, 1] - from_y).max())
        shares = np.linspace(0, 1, max(2, math.ceil(longest / CELL * 1.5)), endpoint=False)
        along_x, along_y = np.outer(ends[:, 0] - from_x, shares), np.outer(ends[:, 1] - from_y, shares)
        passed = self._mask(from_x + along_x.ravel(), from_y + along_y.ravel())
        hit = self._mask(ends[:, 0], ends[:, 1])
        # A cell in which one ray ends and which another one grazes is a wall.
        self._odds[passed & ~hit] += MISS
        self._odds[hit] += HIT
        np.clip(self._odds, -LIMIT, LIMIT, out=self._odds)

    def _mask(self, x: _Floats, y: _Floats) -> NDArray[np.bool_]:
        columns, rows = (cells.astype(np.intp) for cells in self._cells(x, y))
        count = len(self._odds)
        inside = (columns >= 0) & (columns < count) & (rows >= 0) & (rows < count)
        mask = np.zeros(self._odds.shape, np.bool_)
        mask[rows[inside], columns[inside]] = True
        return mask

    # ---------------------------------------------------------------- the file

    def save(self, name: str) -> None:
        """Write NAME.yaml and NAME.pgm in the format of map_server, cut to what was seen.  Raises ValueError."""
        stem = Path(name.removesuffix(".yaml").removesuffix(".yml").removesuffix(".pgm"))
        if not _NAME.fullmatch(stem.name):
            raise ValueError(f"{name!r} is no name for a map: use letters, digits, and _ - . between them")
        with self._lock:
            odds = self._odds.copy()
        rows, columns = np.nonzero(odds)
        if not len(rows):
            rows = columns = np.array([len(odds) // 2])
        first_row, first_column = int(rows.min()), int(columns.min())
        seen = odds[first_row : int(rows.max()) + 1, first_column : int(columns.max()) + 1]
        pixels = np.full(seen.shape, 205, np.uint8)
        pixels[seen > OCCUPIED] = 0
        pixels[seen < FREE] = 254
        head = b"P5\n%d %d\n255\n" % (seen.shape[1], seen.shape[0])
        write_regular(stem.with_name(stem.name + ".pgm"), head + pixels[::-1].tobytes())
        left, bottom = self._left + first_column * CELL, self._bottom + first_row * CELL
        x, y, heading = self._start
        text = (
            f"image: {stem.name}.pgm\nresolution: {CELL}\norigin: [{left:.3f}, {bottom:.3f}, 0.0]\nnegate: 0\n"
            f"occupied_thresh: 0.65\nfree_thresh: 0.196\nhome: [{x:.3f}, {y:.3f}, {heading:.4f}]\n"
        )
        write_regular(stem.with_name(stem.name + ".yaml"), text.encode())


def _best_pose(
    field: _Floats, origin: tuple[float, float], middle: Pose, local: _Floats, step: tuple[float, float, float, float]
) -> tuple[Pose, float]:
    """The pose of a window around ``middle`` at which the mean likelihood of the points is highest, and that mean."""
    width, metres, turn, radians = step
    shifts = np.arange(-round(width / metres), round(width / metres) + 1) * metres
    turns = np.arange(-round(turn / radians), round(turn / radians) + 1) * radians
    best, top = middle, -1.0
    columns0 = (middle[0] - origin[0] + shifts) / CELL + 1
    rows0 = (middle[1] - origin[1] + shifts) / CELL + 1
    away = np.maximum.outer(np.abs(shifts), np.abs(shifts)) / width
    for by in turns:
        c, s = math.cos(middle[2] + by) / CELL, math.sin(middle[2] + by) / CELL
        columns = np.add.outer(columns0, c * local[:, 0] - s * local[:, 1]).astype(np.intp)
        rows = np.add.outer(rows0, s * local[:, 0] + c * local[:, 1]).astype(np.intp)
        np.clip(columns, 0, field.shape[1] - 1, out=columns)
        np.clip(rows, 0, field.shape[0] - 1, out=rows)
        means = field[rows[:, None, :], columns[None, :, :]].mean(axis=2)
        scores = means - KEEP_GUESS * np.maximum(away, abs(by) / turn)
        index = np.unravel_index(int(np.argmax(scores)), scores.shape)
        if scores[index] > top:
            top = float(scores[index])
            best = (
                middle[0] + float(shifts[index[1]]), middle[1] + float(shifts[index[0]]),
                math.remainder(middle[2] + float(by), math.tau),
            )  # fmt: skip
    return best, top
