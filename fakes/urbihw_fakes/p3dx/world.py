"""Walls on a plane: how far a ray goes, how near the nearest wall is, and the same as a map in ARIA's format.

All in m and rad, x to the right, y up, angles counterclockwise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from urbihw_fakes.errors import UnknownRequest

Wall = tuple[float, float, float, float]
Pose = tuple[float, float, float]


def box(left: float, bottom: float, right: float, top: float) -> list[Wall]:
    """The four walls of a box."""
    return [
        (left, bottom, right, bottom),
        (right, bottom, right, top),
        (right, top, left, top),
        (left, top, left, bottom),
    ]


@dataclass
class World:
    """Walls, and where the robot starts."""

    walls: list[Wall] = field(default_factory=list)
    home: Pose = (0.0, 0.0, 0.0)

    @classmethod
    def room(cls) -> World:
        """A room of 8 by 6 m with a wall that leaves a door, and a crate; the robot starts 2 m from the left."""
        return cls([*box(-2, -3, 6, 3), (3.0, -3.0, 3.0, 0.8), (3.0, 2.2, 3.0, 3.0), *box(0.5, -2.0, 1.0, -1.5)])

    @classmethod
    def read(cls, path: str) -> World:
        """The lines and the home of a map in ARIA's format.

        Raises:
            UnknownRequest: it cannot be read or is no such map.
        """
        try:
            lines = Path(path).read_text("latin-1").splitlines()
        except OSError as error:
            raise UnknownRequest(f"world {path}: {error.strerror}") from error
        world = cls()
        inside = False
        try:
            for line in lines:
                words = line.split()
                if words[:1] == ["Cairn:"] and words[1] in ("RobotHome", "Dock"):
                    x, y, heading = map(float, words[2:5])
                    world.home = (x / 1000, y / 1000, math.radians(heading))
                elif words[:1] == ["LINES"]:
                    inside = True
                elif words[:1] == ["DATA"]:
                    inside = False
                elif inside and words:
                    x1, y1, x2, y2 = (int(word) / 1000 for word in words)
                    world.walls.append((x1, y1, x2, y2))
        except ValueError as error:
            raise UnknownRequest(f"world {path}: {line!r} is no line of a map") from error
        if not world.walls:
            raise UnknownRequest(f"world {path}: it has no LINES")
        return world

    def ray(self, x: float, y: float, angle: float, limit: float) -> float:
        """Return the distance in m of the first wall along a ray; at most ``limit``."""
        return self.rays(x, y, (angle,), limit)[0]

    def rays(self, x: float, y: float, angles: Sequence[float], limit: float) -> list[float]:
        """Return the same of several rays from one point."""
        walls = []
        for x1, y1, x2, y2 in self.walls:
            wx, wy, qx, qy = x2 - x1, y2 - y1, x1 - x, y1 - y
            walls.append((wx, wy, qx, qy, qx * wy - qy * wx))
        found = []
        for angle in angles:
            dx, dy = math.cos(angle), math.sin(angle)
            nearest = limit
            for wx, wy, qx, qy, across in walls:
                cross = dx * wy - dy * wx
                if -1e-12 < cross < 1e-12:
                    continue
                distance = across / cross
                if 0.0 <= distance < nearest and 0.0 <= (qx * dy - qy * dx) / cross <= 1.0:
                    nearest = distance
            found.append(nearest)
        return found

    def nearest(self, x: float, y: float) -> tuple[float, float]:
        """Distance of the nearest wall and the direction to it."""
        best, direction = math.inf, 0.0
        for x1, y1, x2, y2 in self.walls:
            wx, wy = x2 - x1, y2 - y1
            length = wx * wx + wy * wy
            along = ((x - x1) * wx + (y - y1) * wy) / length if length else 0.0
            along = min(1.0, max(0.0, along))
            px, py = x1 + along * wx - x, y1 + along * wy - y
            distance = math.hypot(px, py)
            if distance < best:
                best, direction = distance, math.atan2(py, px)
        return best, direction

    def add_crate(self, x: float, y: float, size: float = 0.4) -> None:
        """Put a crate into the world, its middle at x, y."""
        half = size / 2
        self.walls = [*self.walls, *box(x - half, y - half, x + half, y + half)]

    def remove_crate(self) -> None:
        """Take the last crate away again."""
        self.walls = self.walls[:-4]

    def as_map(self) -> str:
        """This world as a map that the planner of a gateway can load."""
        corners = [(x, y) for x1, y1, x2, y2 in self.walls for x, y in ((x1, y1), (x2, y2))]
        home = self.home
        return "\n".join(
            [
                "2D-Map",
                f"LineMinPos: {_mm(min(x for x, _ in corners))} {_mm(min(y for _, y in corners))}",
                f"LineMaxPos: {_mm(max(x for x, _ in corners))} {_mm(max(y for _, y in corners))}",
                f"NumLines: {len(self.walls)}",
                f'Cairn: RobotHome {_mm(home[0])} {_mm(home[1])} {math.degrees(home[2]):g} "" ICON "Home"',
                "LINES",
                *(" ".join(str(_mm(value)) for value in wall) for wall in self.walls),
                "DATA",
                "",
            ]
        )


def _mm(metres: float) -> int:
    return round(metres * 1000)
