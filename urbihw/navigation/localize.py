"""Localization on a map: shifts a laser scan until its points lie on the walls; no I/O.

A pose that is known well is tracked (``track_scan``): the least squares of the distances of the readings' end points to
the walls where they were measured.  A reading that is far from all walls does not pull (Tukey's weights): something
stands there that the map does not show.  The pose stays as it is in directions of which the scan tells nothing.

One that is known to some decimetres and ten degrees is searched first (``match_scan``): hill climbing with decreasing
steps, by a score of the end points to which a near wall adds.

Whether the robot is there is judged by the readings that tell something: those that end at a wall of the map, and those
that go through one.  A reading that ends before the walls tells nothing: a box or a person stands there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from urbihw.frozen import frozen
from urbihw.navigation.belief import Symmetric
from urbihw.navigation.frames import Pose, wrapped
from urbihw.navigation.grid import Grid

MAX_POINTS: Final = 60
"""Maximum number of readings used of a scan."""
CELL: Final = 0.05
"""Size in m of the cells of the grid to which scans are matched."""
NEAR_WALL: Final = 0.25
"""Distance in m to a wall up to which a point adds to the score; a nearer point adds more."""
CLEAR_SCORE: Final = 0.7
"""Minimum share of the maximum score, over the readings that tell something, for a localized robot."""
TELLING_SHARE: Final = 0.2
"""Minimum share of such readings."""
FORBIDDEN_SHARE: Final = 0.15
"""Minimum share of the readings that go through walls for a robot that is somewhere else."""
STEPS: Final = ((0.1, 0.05), (0.05, 0.02), (0.02, 0.01), (0.01, 0.005))
"""The steps of the search, in m and rad."""
ROUNDS: Final = 6
SPACING, SPACING_TURN, CLIMBS = 0.25, 0.2, 5
"""m and rad between the places near a guess that are tried, and how many of the best are improved."""
KEEP_GUESS: Final = 0.02
"""What a pose loses per m or rad from the guess, so that the guess wins among equals (along a corridor)."""
REFINEMENTS: Final = 3
REFINED_REACH, LARGEST_REACH = 0.12, 0.4
"""Steps of least squares, and the distances in m to a wall up to which a point counts in them."""
READING: Final = 1 / (8 * 0.03**2)
"""What a reading tells, in 1/m^2: its standard deviation is 3 cm, and eight of them err together."""
HELD: Final = Symmetric(100.0, 100.0, 100.0)
"""How a pose is held in directions of which the scan tells nothing: 1/m^2 and 1/rad^2."""


@frozen
class Match:
    """The best pose near a guess.

    Attributes:
        score: share of the readings that the map explains, from 0 to 1; a reading beside a wall counts in part.
        fit: the same of the readings that tell something.
        telling: their share.
        forbidden: share of the readings that go through walls, and end beside none.
    """

    pose: Pose
    score: float
    fit: float = 0.0
    telling: float = 0.0
    forbidden: float = 0.0

    @property
    def is_there(self) -> bool:
        """Whether the robot is at the pose, as far as the scan tells."""
        return self.fit >= CLEAR_SCORE and self.telling >= TELLING_SHARE

    @property
    def contradicts(self) -> bool:
        """Whether the scan speaks against the pose; one that tells nothing does not."""
        return self.fit < CLEAR_SCORE and self.forbidden >= FORBIDDEN_SHARE

    @property
    def merit(self) -> float:
        """What one pose has before another."""
        return self.score - self.forbidden


def match_scan(grid: Grid, guess: Pose, points: Sequence[tuple[float, float]], place: float) -> Match:
    """Match a scan, (distance, angle) from a laser ``place`` m ahead of the robot's middle, with the walls of a grid,
    some decimetres around a guess."""
    local = _ends(points, place)
    if not local:
        return Match(guess, 0.0)
    climbed = _climb(grid, guess, local)
    pose, _ = _refine(grid, climbed, local, HELD)
    return judge_scan(grid, pose, points, place)


def track_scan(
    grid: Grid, guess: Pose, known: Symmetric, spread: float, points: Sequence[tuple[float, float]], place: float
) -> tuple[Match, Symmetric]:
    """Match a scan with the walls near a guess that is known so well: ``known`` is the inverse of its covariance,
    ``spread`` its standard deviation in m.  Returns the inverse of that of the match, too."""
    local = _ends(points, place)
    reach = min(LARGEST_REACH, REFINED_REACH + 2 * spread)
    pose, information = _refine(grid, guess, local, known, reach)
    return judge_scan(grid, pose, points, place), information


def search_near(grid: Grid, guess: Pose, points: Sequence[tuple[float, float]], place: float) -> Match:
    """The best match within some 0.7 m and 30 degrees of a guess."""
    local = _ends(points, place)
    x, y, heading = guess
    starts = [
        (x + right * SPACING, y + up * SPACING, wrapped(heading + turn * SPACING_TURN))
        for right in range(-2, 3) for up in range(-2, 3) for turn in range(-2, 3)
    ]  # fmt: skip
    starts.sort(key=lambda pose: _score(grid, pose, local) if local else 0.0, reverse=True)
    matches = [match_scan(grid, start, points, place) for start in starts[:CLIMBS]]
    return max(matches, key=lambda match: match.merit)


def _climb(grid: Grid, guess: Pose, local: list[tuple[float, float]]) -> Pose:
    """The pose near a guess with the highest score."""

    def value(pose: Pose) -> float:
        away = math.dist(pose[:2], guess[:2]) + abs(wrapped(pose[2] - guess[2]))
        return _score(grid, pose, local) - KEEP_GUESS * away

    best, score = guess, value(guess)
    for metres, radians in STEPS:
        for _ in range(ROUNDS):
            x, y, heading = best
            around = [
                (x + metres, y, heading), (x - metres, y, heading), (x, y + metres, heading), (x, y - metres, heading),
                (x, y, wrapped(heading + radians)), (x, y, wrapped(heading - radians)),
            ]  # fmt: skip
            scores = [value(pose) for pose in around]
            top = max(scores)
            if top <= score:
                break
            best, score = around[scores.index(top)], top
    return best


def _refine(
    grid: Grid, guess: Pose, local: list[tuple[float, float]], known: Symmetric, reach: float = REFINED_REACH
) -> tuple[Pose, Symmetric]:
    """The pose near a guess at which the readings near walls are nearest to them, and the inverse of its covariance:
    Gauss and Newton's method, with Tukey's weights up to ``reach`` m, which becomes less with each step."""
    pose, information = guess, known
    for step in range(REFINEMENTS):
        within = max(REFINED_REACH, reach / 2**step)
        measured, pull = _pull(grid, pose, local, within)
        information = known + measured
        hold = known.times(pose[0] - guess[0], pose[1] - guess[1], wrapped(pose[2] - guess[2]))
        dx, dy, dt = information.inverse().times(*(a + b for a, b in zip(hold, pull, strict=True)))
        pose = pose[0] - dx, pose[1] - dy, wrapped(pose[2] - dt)
    return pose, information


def _pull(
    grid: Grid, pose: Pose, local: list[tuple[float, float]], reach: float
) -> tuple[Symmetric, tuple[float, float, float]]:
    """What the readings near walls tell of a pose: their information, and the gradient of their squares."""
    x, y, heading = pose
    c, s = math.cos(heading), math.sin(heading)
    xx = yy = tt = xy = xt = yt = gx = gy = gt = 0.0
    for px, py in local:
        rx, ry = c * px - s * py, s * px + c * py
        off, wall_x, wall_y = grid.nearest(x + rx, y + ry, reach)
        if not 0 < off < reach:
            continue
        ux, uy = (x + rx - wall_x) / off, (y + ry - wall_y) / off
        turn = uy * rx - ux * ry
        weight = READING * (1 - (off / reach) ** 2) ** 2
        wx, wy, wt = weight * ux, weight * uy, weight * turn
        xx, yy, tt = xx + wx * ux, yy + wy * uy, tt + wt * turn
        xy, xt, yt = xy + wx * uy, xt + wx * turn, yt + wy * turn
        gx, gy, gt = gx + wx * off, gy + wy * off, gt + wt * off
    return Symmetric(xx, yy, tt, xy, xt, yt), (gx, gy, gt)


def judge_scan(grid: Grid, pose: Pose, points: Sequence[tuple[float, float]], place: float) -> Match:
    """Judge how a scan that was taken at a pose agrees with the walls."""
    x, y, heading = pose
    laser = x + place * math.cos(heading), y + place * math.sin(heading)
    local = _ends(points, place)
    telling, through, total = 0, 0, 0.0
    for (r, angle), end in zip(points[:: _step(points)], local, strict=True):
        gain = _score(grid, pose, [end])
        if gain or r > _free_way(grid, laser, heading + angle, r + NEAR_WALL) + NEAR_WALL:
            telling += 1
            through += not gain
            total += gain
    count = len(local) or 1
    return Match(pose, total / count, total / telling if telling else 0.0, telling / count, through / count)


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
