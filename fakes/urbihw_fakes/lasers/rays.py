"""What a laser measures in the room: distances along rays from its place on a robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

LASER_X = 0.021
"""m from the middle of a Pioneer ahead to its laser."""


class Walls(Protocol):
    """A room, as the laser meets its walls."""

    def rays(self, x: float, y: float, angles: Sequence[float], limit: float) -> list[float]:
        """Return the distance in m of the first wall along each ray; at most ``limit``."""
        ...


class Carrier(Protocol):
    """A robot that carries a laser: its true pose (m, m, rad) in a world of walls."""

    @property
    def pose(self) -> tuple[float, float, float]:
        """Where it truly is."""
        ...

    @property
    def world(self) -> Walls:
        """The room in which the carrier stands."""
        ...

    def advance(self, now: float) -> None:
        """Move on to ``now``."""
        ...


def distances(body: Carrier, angles: Sequence[float], farthest: float) -> list[float]:
    """Distances in m from the laser in these directions, rad to the left of the robot's front."""
    x, y, heading = body.pose
    lx, ly = x + LASER_X * math.cos(heading), y + LASER_X * math.sin(heading)
    return body.world.rays(lx, ly, [heading + angle for angle in angles], farthest)
