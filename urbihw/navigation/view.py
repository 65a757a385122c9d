"""What a base sees and knows of the way in front of it, for the planner and for who follows a path."""

from __future__ import annotations

import math
from typing import Final, Protocol

from urbihw.navigation.base import DrivenBase
from urbihw.navigation.frames import Point, Pose, distance_to_line
from urbihw.navigation.grid import Grid
from urbihw.navigation.obstacles import free_way
from urbihw.navigation.options import SCAN
from urbihw.navigation.planner import Room
from urbihw.navigation.standing import is_clear

LEAST_CLEARANCE: Final = 0.01
"""Clearance in m between the robot's radius and walls where no wider way leads, of a robot that sees them."""
SIDE_CLEARANCE: Final = 0.03
"""Clearance in m beside the robot's radius that must be free ahead; none where the way is narrow."""
UNSURE_SPEED: Final = 0.1
"""m/s on paths while the scans do not tell where the robot is."""


class SureOfPose(Protocol):
    """Who keeps the pose by scans."""

    is_sure: bool
    """The last scan agreed with the map."""


class NavigatorView:
    """The view of a base.

    Attributes:
        grid: the walls of the map, without those that are gone; None without a map.
        beside: the obstacles close by the path, which it was planned around.
    """

    def __init__(self, base: DrivenBase, locator: SureOfPose) -> None:
        self._base = base
        self._locator = locator
        self.grid: Grid | None = None
        self.beside: list[Point] = []

    @property
    def uses_scans(self) -> bool:
        """Whether scans correct the pose."""
        return self._base.navigation.localization == SCAN

    @property
    def clearance(self) -> float:
        """Distance in m that paths keep from walls, from the middle of the base."""
        return self._base.radius + self._base.navigation.clearance

    def room(self) -> Room:
        """The distances that paths keep; only a robot that sees its walls goes nearer to them than it wants."""
        clear = self.clearance
        return Room(clear, min(clear, self._base.radius + LEAST_CLEARANCE) if self.uses_scans else clear)

    def pose(self) -> Pose:
        """Where the base is on the map."""
        return self._base.odometry.absolute

    def is_outside(self) -> bool:
        """Whether that is outside the map."""
        return self.grid is not None and not self.grid.holds(*self.grid.column_row(*self.pose()[:2]))

    def fastest(self) -> float:
        """The most speed in m/s at which the base may follow a path, as far as it knows where it is."""
        return UNSURE_SPEED if self.uses_scans and not self._locator.is_sure else math.inf

    def free_way(self, curvature: float, narrow: bool) -> float:
        """Free distance in m ahead of the robot's hull along an arc (1/m)."""
        return free_way(self.echoes(), curvature, self._base.radius, 0.0 if narrow else SIDE_CLEARANCE)

    def is_narrow(self, a: Point, b: Point, margin: float) -> bool:
        """Whether the walls of the map, or obstacles that the path knows, leave less room beside a line than paths want
        and a margin in m.  Before an obstacle that it does not know yet the robot stops, and plans another path."""
        room = self.clearance + margin
        if any(distance_to_line(each, a, b) < room for each in self.beside):
            return True
        return self.grid is not None and not is_clear(self.grid, a, b, room)

    def echoes(self) -> list[Point]:
        """Points that the scanner and other sensors detect now, in m ahead of and to the left of the middle of the
        base."""
        scanner = self._base.scanner
        if scanner is None:
            return self._base.obstacles()
        seen = [(scanner.place + r * math.cos(a), r * math.sin(a)) for r, a in scanner.fresh_echoes()]
        return seen + self._base.obstacles()
