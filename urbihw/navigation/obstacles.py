"""Obstacles that sensors see and the map does not show: a layer of cells over the map, and the free way ahead; no I/O.

A cell is marked by an echo.  It is cleared when a ray of a later scan passes through it (the inverse sensor model of
Thrun, Burgard, Fox: Probabilistic Robotics, 2005, table 9.2: of each marked cell, the ray nearest to its direction
decides), and fades after ``FADE_S`` without a new echo.  Like ROS's obstacle layer it takes a ray without an echo for
no proof of free space.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import Final

from urbihw.navigation.base import Echo
from urbihw.navigation.frames import Point, Pose
from urbihw.navigation.grid import Grid

FADE_S: Final = 20.0
"""Seconds after which a mark without a new echo is dropped."""
MARK_RANGE: Final = 3.0
"""Distance in m up to which echoes mark cells: beyond, a small error of the heading moves them too far."""
WALL_MARGIN: Final = 0.2
"""Distance in m to a wall of the map below which an echo is taken for that wall."""

_STRAIGHT: Final = 1e-3
"""Curvature in 1/m below which an arc counts as straight."""


class ObstacleLayer:
    """The marked cells over a grid."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._seen_at: dict[tuple[int, int], float] = {}

    def add_points(self, points: Sequence[Point], now: float) -> None:
        """Mark the cells of points on the map; ``now`` in s."""
        for point in points:
            self._seen_at[self._grid.column_row(*point)] = now

    def add_scan(self, scanner: Pose, echoes: Sequence[Echo], now: float) -> None:
        """Clear the cells through which the rays of a scan pass, and mark those where they end beside the walls of the
        map.  ``scanner`` is its pose on the map, ``now`` in s."""
        if not echoes:
            return
        x, y, heading = scanner
        self._clear(scanner, sorted((math.remainder(a, math.tau), r) for r, a in echoes))
        grid = self._grid
        for r, a in echoes:
            if r <= MARK_RANGE:
                place = (x + r * math.cos(heading + a), y + r * math.sin(heading + a))
                if grid.distance(*place) > WALL_MARGIN:
                    self._seen_at[grid.column_row(*place)] = now

    def _clear(self, scanner: Pose, rays: list[tuple[float, float]]) -> None:
        x, y, heading = scanner
        cell = self._grid.cell
        for place in list(self._seen_at):
            px, py = self._grid.middle(*place)
            distance = math.hypot(px - x, py - y)
            angle = math.remainder(math.atan2(py - y, px - x) - heading, math.tau)
            index = bisect_left(rays, (angle, 0.0))
            near = min(rays[max(0, index - 1) : index + 1], key=lambda ray: abs(ray[0] - angle))
            if abs(near[0] - angle) * distance <= cell / 2 and near[1] > distance + cell:
                del self._seen_at[place]

    def points(self, now: float) -> list[Point]:
        """The middles of the marked cells, without those that have faded."""
        self._seen_at = {place: stamp for place, stamp in self._seen_at.items() if now - stamp < FADE_S}
        return [self._grid.middle(*place) for place in self._seen_at]


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


def closes_path(points: Sequence[Point], path: Sequence[Point], clearance: float, reach: float) -> bool:
    """Whether a point is nearer than ``clearance`` m to the first ``reach`` m of a path."""
    for a, b in zip(path, path[1:], strict=False):
        length = math.dist(a, b)
        share = min(1.0, reach / length) if length else 1.0
        end = (a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share)
        if any(_distance(point, a, end) < clearance for point in points):
            return True
        reach -= length
        if reach <= 0:
            break
    return False


def _distance(point: Point, a: Point, b: Point) -> float:
    """Distance of a point from a line between two others."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    share = max(0.0, min(1.0, ((point[0] - a[0]) * dx + (point[1] - a[1]) * dy) / square)) if square else 0.0
    return math.dist(point, (a[0] + share * dx, a[1] + share * dy))
