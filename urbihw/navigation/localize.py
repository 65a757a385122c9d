"""Localization on a map: shifts a laser scan until its points lie on the walls; no I/O.

A pose scores by the distances of the readings' end points to occupied cells.  Hill climbing with decreasing steps
improves the pose of the odometry by up to some decimetres and about ten degrees: enough to compensate slip, not to find
a robot that was carried away.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from urbihw.navigation.frames import Pose, wrapped
from urbihw.navigation.grid import Grid

MAX_POINTS: Final = 60
"""Maximum number of readings used of a scan."""
CELL: Final = 0.05
"""Size in m of the cells of the grid to which scans are matched."""
NEAR_WALL: Final = 0.25
"""Distance in m to a wall up to which a point adds to the score; a nearer point adds more."""
GOOD_SCORE: Final = 0.5
"""Minimum share of the maximum score for a localized robot."""
CLEAR_SCORE: Final = 0.7
"""Minimum of the same for a robot between things that the map does not show, over the readings that tell something."""
TELLING_SHARE: Final = 0.2
"""Minimum share of such readings."""
STEPS: Final = ((0.1, 0.05), (0.05, 0.02), (0.02, 0.01), (0.01, 0.005))
"""The steps of the search, in m and rad."""
ROUNDS: Final = 6


@dataclass(frozen=True, slots=True)
class Match:
    """The best pose near a guess, and the score of the scan there, from 0 to 1."""

    pose: Pose
    score: float


def match_scan(grid: Grid, guess: Pose, points: Sequence[tuple[float, float]], place: float) -> Match:
    """Match a scan, (distance, angle) from a laser ``place`` m ahead of the robot's middle, with the walls of a
    grid."""
    local = _ends(points, place)
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


def is_hidden(grid: Grid, pose: Pose, points: Sequence[tuple[float, float]], place: float) -> bool:
    """Return whether a scan matches the walls badly only since things stand before them that the map does not show.

    A reading that is shorter than the way to the wall tells nothing about the pose; one that goes through a wall does.
    """
    x, y, heading = pose
    laser = x + place * math.cos(heading), y + place * math.sin(heading)
    local = _ends(points, place)
    telling, total = 0, 0.0
    for (r, angle), end in zip(points[:: _step(points)], local, strict=True):
        gain = _score(grid, pose, [end])
        if gain or r > _free_way(grid, laser, heading + angle, r + NEAR_WALL) - NEAR_WALL:
            telling += 1
            total += gain
    return telling >= TELLING_SHARE * len(local) and total >= CLEAR_SCORE * telling > 0


def _free_way(grid: Grid, start: tuple[float, float], angle: float, longest: float) -> float:
    """Return the distance in m from a point to the first wall in a direction; inf if it is farther than ``longest``."""
    way, (c, s) = 0.0, (math.cos(angle), math.sin(angle))
    while way < longest:
        free = grid.distance(start[0] + way * c, start[1] + way * s)
        if free < grid.cell:
            return way
        if free == math.inf:
            break  # off the map
        way += free
    return math.inf


def _step(points: Sequence[tuple[float, float]]) -> int:
    return max(1, len(points) // MAX_POINTS)


def _ends(points: Sequence[tuple[float, float]], place: float) -> list[tuple[float, float]]:
    """Where some of the readings end, in the frame of the robot."""
    return [(place + r * math.cos(a), r * math.sin(a)) for r, a in points[:: _step(points)]]


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
            if distance < NEAR_WALL:
                total += 1.0 - distance / NEAR_WALL
    return total / len(local)
