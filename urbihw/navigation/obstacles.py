"""Obstacles that sensors see and the map does not show, what the map shows and is gone, and the free way ahead; no I/O.

A cell is marked by an echo.  It is cleared when a ray of a later scan passes through it (the inverse sensor model of
Thrun, Burgard, Fox: Probabilistic Robotics, 2005, table 9.2: of each marked cell, the ray nearest to its direction
decides), and fades after ``FADE_S`` without a new echo.  Like ROS's obstacle layer it takes a ray without an echo for
no proof of free space.

A cell of a wall is gone when the rays of ``GONE_AFTER`` scans have passed through it: the furniture was moved.  Echoes
there bring it back.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from typing import Final

from urbihw.navigation.base import Echo
from urbihw.navigation.frames import Point, Pose, distance_to_line
from urbihw.navigation.grid import Grid

FADE_S: Final = 20.0
"""Seconds after which a mark without a new echo is dropped."""
STANDS_S, STOOD_FADE_S = 5.0, 180.0
"""Seconds of echoes after which something stands there, and then the seconds after which its mark is dropped: else a
robot between two ways that are closed would forget the one while it looks at the other."""
MARK_RANGE: Final = 3.0
"""Distance in m up to which echoes mark cells: beyond, a small error of the heading moves them too far."""
WALL_MARGIN: Final = 0.2
"""Distance in m to a wall of the map below which an echo is taken for that wall."""
PASS_RANGE: Final = 4.0
"""Distance in m up to which rays pass through walls."""
PASS_MARGIN, PASS_BESIDE = 0.3, 0.15
"""m that a ray must go on behind a wall, and from other walls there: so one along a wall, or just beside it, passes
through nothing, though the pose is some centimetres off."""
GONE_AFTER: Final = 8
"""Scans that must pass through a wall more than see it."""
SEEN_AGAIN: Final = 3
"""Scans that pass which one echo outweighs."""

_STRAIGHT: Final = 1e-3
"""Curvature in 1/m below which an arc counts as straight."""


class ObstacleLayer:
    """The marked cells over a grid.

    Attributes:
        grid: the walls of the map, without those that are gone.
        gone: the cells of the map that are gone, by their index.
    """

    def __init__(self, grid: Grid) -> None:
        self.grid = grid
        self.gone: frozenset[int] = frozenset()
        self._map = grid
        self._seen: dict[tuple[int, int], tuple[float, float, Point]] = {}
        """Times of the first and of the last echo in each marked cell, and the place of the last."""
        self._passes: dict[int, int] = {}

    def add_points(self, points: Sequence[Point], now: float) -> None:
        """Mark the cells of points on the map; ``now`` in s."""
        for point in points:
            self._mark(point, now)

    def _mark(self, point: Point, now: float) -> None:
        cell = self.grid.column_row(*point)
        first, last, _ = self._seen.get(cell, (now, now, point))
        self._seen[cell] = first if now - last < FADE_S else now, now, point

    def add_scan(self, scanner: Pose, echoes: Sequence[Echo], now: float) -> None:
        """Clear the cells through which the rays of a scan pass, and mark those where they end beside the walls of the
        map.  ``scanner`` is its pose on the map, ``now`` in s."""
        if not echoes:
            return
        x, y, heading = scanner
        self._clear(scanner, sorted((math.remainder(a, math.tau), r) for r, a in echoes))
        grid = self.grid
        for r, a in echoes:
            if r <= MARK_RANGE:
                place = (x + r * math.cos(heading + a), y + r * math.sin(heading + a))
                if grid.distance(*place) > WALL_MARGIN:
                    self._mark(place, now)

    def _clear(self, scanner: Pose, rays: list[tuple[float, float]]) -> None:
        x, y, heading = scanner
        cell = self.grid.cell
        for place, (_, _, (px, py)) in list(self._seen.items()):
            distance = math.hypot(px - x, py - y)
            angle = math.remainder(math.atan2(py - y, px - x) - heading, math.tau)
            index = bisect_left(rays, (angle, 0.0))
            near = min(rays[max(0, index - 1) : index + 1], key=lambda ray: abs(ray[0] - angle))
            if abs(near[0] - angle) * distance <= cell / 2 and near[1] > distance + cell:
                del self._seen[place]

    def points(self, now: float) -> list[Point]:
        """The last echo in each marked cell, without those that have faded."""
        self._seen = {
            cell: (first, last, point) for cell, (first, last, point) in self._seen.items()
            if now - last < (STOOD_FADE_S if last - first >= STANDS_S else FADE_S)
        }  # fmt: skip
        return [point for _, _, point in self._seen.values()]

    def recent_points(self, now: float) -> list[Point]:
        """Those that were seen within ``FADE_S``, whatever stood there."""
        return [point for _, last, point in self._seen.values() if now - last < FADE_S]

    # ---------------------------------------------------------------- what is gone

    def pass_walls(self, scanner: Pose, echoes: Sequence[Echo]) -> None:
        """Find walls of the map that are gone, by a scan whose pose is well known."""
        x, y, heading = scanner
        passed: set[int] = set()
        for r, a in echoes:
            passed.update(self._passed((x, y), (math.cos(heading + a), math.sin(heading + a)), r))
        passes = self._passes
        for index in passed:
            passes[index] = min(passes.get(index, 0) + 1, GONE_AFTER + SEEN_AGAIN)
        for index in self._ends(scanner, echoes) if passes else ():
            if index in passes:
                passes[index] -= SEEN_AGAIN
        self._passes = {index: count for index, count in passes.items() if count > 0}
        self.gone = frozenset(
            index for index, count in self._passes.items() if count >= GONE_AFTER or index in self.gone
        )

    def _passed(self, start: Point, direction: Point, length: float) -> Iterator[int]:
        """The cells of walls through which a ray passes."""
        grid, map_ = self.grid, self._map
        distances, (dx, dy), way = grid.distances(), direction, 0.0
        last = min(length, PASS_RANGE) - PASS_MARGIN
        while way < last:
            column, row = grid.column_row(start[0] + way * dx, start[1] + way * dy)
            if not grid.holds(column, row):
                return
            index = row * grid.width + column
            if map_.blocked[index] and not map_.fixed[index]:
                behind = way + PASS_MARGIN
                if grid.distance(start[0] + behind * dx, start[1] + behind * dy) >= PASS_BESIDE:
                    yield index
            way += max(grid.cell / 2, distances[index] - grid.cell)

    def _ends(self, scanner: Pose, echoes: Sequence[Echo]) -> set[int]:
        """The cells in and beside which rays end."""
        (x, y, heading), grid = scanner, self.grid
        ends: set[int] = set()
        for r, a in echoes:
            if r <= PASS_RANGE:
                column, row = grid.column_row(x + r * math.cos(heading + a), y + r * math.sin(heading + a))
                index = row * grid.width + column
                ends.update(index + down + right for down in (-grid.width, 0, grid.width) for right in (-1, 0, 1))
        return ends


def free_way(points: Sequence[Point], curvature: float, radius: float, margin: float) -> float:
    """Distance in m that a round hull can drive along an arc until it touches a point; inf if it touches none.

    The points are in m ahead of and to the left of its middle; ``curvature`` in 1/m, to the left; a point closer than
    ``margin`` beside the hull counts as touched.
    """
    lane = radius + margin
    best = math.inf
    bend = 0.0 if abs(curvature) < _STRAIGHT else 1 / curvature
    for x, y in points:
        if bend:
            across = math.hypot(x, y - bend) - abs(bend)
            # The angle around the center of the arc, in the direction of driving.
            along = abs(bend) * (math.atan2(x, math.copysign(1.0, bend) * (bend - y)) % math.tau)
            if along > math.pi * abs(bend):
                continue
        else:
            across, along = y, x
        if along > 0 and abs(across) <= lane:
            best = min(best, along - math.sqrt(max(0.0, radius * radius - across * across)))
    return best


def close_by(points: Sequence[Point], path: Sequence[Point], distance: float) -> list[Point]:
    """The points that are nearer than ``distance`` m to a path."""
    lines = list(zip(path, path[1:], strict=False))
    return [point for point in points if any(distance_to_line(point, a, b) < distance for a, b in lines)]


def closes_path(points: Sequence[Point], path: Sequence[Point], clearance: float, reach: float) -> bool:
    """Whether a point is nearer than ``clearance`` m to the first ``reach`` m of a path."""
    for a, b in zip(path, path[1:], strict=False):
        length = math.dist(a, b)
        share = min(1.0, reach / length) if length else 1.0
        end = (a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share)
        if any(distance_to_line(point, a, end) < clearance for point in points):
            return True
        reach -= length
        if reach <= 0:
            break
    return False
