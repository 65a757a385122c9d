"""Two simulated rooms with a corridor between them, as wide as told, for the bench of navigation."""

from __future__ import annotations

import math

from urbihw.navigation.frames import Point, Pose
from urbihw.navigation.grid import Grid
from urbihw_fakes.p3dx.world import Wall, World

ROOM, LENGTH = 4.0, 3.0
"""m: the sides of a room, and the corridor."""
WIDTHS = (0.55, 0.6, 0.62, 0.65, 0.7)
OFFSETS = (0.0, 0.012, 0.025, 0.037, 0.05, 0.071)
"""m from the lines of a grid of 0.1 m to the corridor's middle."""
TURNS = (0.0, 17.0, 45.0)
"""Degrees by which all of it is turned."""


class Corridor:
    """A room, a corridor that leads to the right from it, and another room.

    Attributes:
        shown: what is there, which is what the map shows.
        width: m of the corridor.
    """

    keeps = (0.1,)
    """m from the walls of the way that counts as the shortest."""

    def __init__(self, width: float, offset: float, degrees: float = 0.0) -> None:
        self.width = width
        self._turn = math.radians(degrees)
        middle = ROOM / 2 + offset
        low, high, far = middle - width / 2, middle + width / 2, ROOM + LENGTH
        walls: list[Wall] = [
            (0, 0, ROOM, 0), (0, ROOM, ROOM, ROOM), (0, 0, 0, ROOM), (ROOM, 0, ROOM, low), (ROOM, high, ROOM, ROOM),
            (ROOM, low, far, low), (ROOM, high, far, high), (far, 0, far, low), (far, high, far, ROOM),
            (far, 0, far + ROOM, 0), (far, ROOM, far + ROOM, ROOM), (far + ROOM, 0, far + ROOM, ROOM),
        ]  # fmt: skip
        self.shown: list[Wall] = [(*self._at(*wall[:2]), *self._at(*wall[2:])) for wall in walls]
        self.world = World(list(self.shown), self.pose(1.2, 1.0, 1.0))
        xs, ys = zip(*(corner for wall in self.shown for corner in (wall[:2], wall[2:])), strict=True)
        self.grid = Grid(min(xs), min(ys), max(xs), max(ys), 0.02)
        for wall in self.shown:
            self.grid.block_line(*wall)

    def _at(self, x: float, y: float) -> Point:
        c, s = math.cos(self._turn), math.sin(self._turn)
        return c * x - s * y, s * x + c * y

    def pose(self, x: float, y: float, heading: float) -> Pose:
        """A pose of the plan, as it is turned."""
        return (*self._at(x, y), heading + self._turn)

    def goals(self) -> tuple[Pose, Pose]:
        """A place in the other room, and one in the first."""
        return self.pose(ROOM + LENGTH + 2.5, 2.8, 0.5), self.pose(1.5, 1.2, -2.0)

    def move_boxes(self, robot: Point) -> None:
        """Move nothing: there are no boxes."""
