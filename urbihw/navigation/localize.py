"""Where the robot is on a map: a laser scan is moved about until its points lie on the walls; no I/O.

A pose is good when the ends of the readings are near occupied cells.  The pose that the odometry says is improved by
steps that get smaller (hill climbing), which finds its way over some decimetres and some ten degrees: enough to keep up
with slip, not to find a robot that was carried away.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from urbihw.navigation.frames import Pose, wrapped
from urbihw.navigation.grid import Grid

POINTS: Final = 60
"""Readings used of a scan."""
CELL: Final = 0.05
"""m; size of the cells of the grid that scans are fitted to."""
NEAR: Final = 0.25
"""m within which a point counts as seen on a wall, the nearer the more."""
GOOD: Final = 0.5
"""Share of the greatest score that a localized robot has."""
STEPS: Final = ((0.1, 0.05), (0.05, 0.02), (0.02, 0.01), (0.01, 0.005))
"""m and rad."""
ROUNDS: Final = 6


@dataclass(frozen=True, slots=True)
class Match:
    """The best pose near a guess, and how well the scan fits there, from 0 to 1."""

    pose: Pose
    score: float


def match(grid: Grid, guess: Pose, points: Sequence[tuple[float, float]], place: float) -> Match:
    """Fit a scan, (distance, angle) from a laser ``place`` m ahead of the robot's middle, to the walls of a grid."""
    step = max(1, len(points) // POINTS)
    local = [(place + r * math.cos(a), r * math.sin(a)) for r, a in points[::step]]
    if not local:
        return Match(guess, 0.0)
    best, score = guess, _score(grid, guess, local)
    for metres, radians in STEPS:
        for _ in range(ROUNDS):
            x, y, heading = best
            around = [
                (x + metres, y, heading), (x - metres, y, heading), (x, y + metres, heading), (x, y - metres, heading),
                (x, y, wrapped(heading + radians)), (x, y, wrapped(heading - radians)),
            ]  # fmt: skip
            scores = [_score(grid, pose, local) for pose in around]
            top = max(scores)
            if top <= score:
                break
            best, score = around[scores.index(top)], top
    return Match(best, score)


def _score(grid: Grid, pose: Pose, local: list[tuple[float, float]]) -> float:
    x, y, heading = pose
    c, s = math.cos(heading), math.sin(heading)
    distances, cell, width, height = grid.distances(), grid.cell, grid.width, grid.height
    ox, oy = x - grid.left, y - grid.bottom
    total = 0.0
    for px, py in local:
        column, row = int((ox + c * px - s * py) / cell), int((oy + s * px + c * py) / cell)
        if 0 <= column < width and 0 <= row < height:
            distance = distances[row * width + column]
            if distance < NEAR:
                total += 1.0 - distance / NEAR
    return total / len(local)
