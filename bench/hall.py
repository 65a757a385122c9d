"""A simulated hall of 20 by 20 m for the bench of navigation: walls, doors and crates that the map shows, and boxes
that move, which it does not."""

from __future__ import annotations

import math
import random

from urbihw.navigation.frames import Point, Pose
from urbihw.navigation.grid import Grid
from urbihw_fakes.p3dx.body import RADIUS
from urbihw_fakes.p3dx.world import Wall, World, box

SIZE = 20.0
CRATES, BOXES = 10, 8
CRATE, BOX = 0.6, 0.5
BOX_SPEED = 0.3
BOX_STEP_S = 0.1
RESPECT = RADIUS + BOX * 0.71 + 0.25
"""m from the middle of a robot at which a box stops."""

DOORS: tuple[Wall, ...] = (
    (7, 0, 7, 5), (7, 6.5, 7, 14), (7, 15.5, 7, 20), (13, 0, 13, 3), (13, 4.5, 13, 11), (13, 12.5, 13, 20),
    (0, 10, 3, 10), (4.5, 10, 7, 10), (13, 9, 16, 9), (17.5, 9, 20, 9),
)  # fmt: skip
START: Pose = (2.0, 2.0, 0.0)


class Hall:
    """The hall: walls and crates as the map shows them, and boxes that move."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.shown: list[Wall] = [*box(0, 0, SIZE, SIZE), *DOORS]
        self._draw()
        for _ in range(CRATES):
            x, y = self.place(1.3)
            half = CRATE / 2
            self.shown += box(x - half, y - half, x + half, y + half)
            self._draw()
        self.world = World(list(self.shown), START)
        self.boxes = [Box(self, self.place(0.8)) for _ in range(BOXES)]

    def _draw(self) -> None:
        self.grid = Grid(0, 0, SIZE, SIZE, 0.1)
        for wall in self.shown:
            self.grid.block_line(*wall)

    def place(self, free: float) -> Point:
        """A random place at some distance from all that the map shows, and from the start."""
        while True:
            at = self.random.uniform(0.5, SIZE - 0.5), self.random.uniform(0.5, SIZE - 0.5)
            if self.grid.distance(*at) >= free and math.dist(at, START[:2]) > 1.5:
                return at

    def is_clear(self, a: Point, b: Point, free: float) -> bool:
        """Whether a straight line keeps some distance from all that the map shows."""
        shares = [step / 40 for step in range(41)]
        return all(self.grid.distance(a[0] + (b[0] - a[0]) * s, a[1] + (b[1] - a[1]) * s) >= free for s in shares)

    def move_boxes(self, robot: Point) -> None:
        """One step of all boxes."""
        walls = list(self.shown)
        for each in self.boxes:
            each.step(robot)
            walls += each.walls()
        self.world.walls[:] = walls


class Box:
    """A box that goes from place to place, and rests at each."""

    def __init__(self, hall: Hall, at: Point) -> None:
        self.at = at
        self._hall = hall
        self._goal = at
        self._rests = 0.0

    def walls(self) -> list[Wall]:
        """Its four sides."""
        (x, y), half = self.at, BOX / 2
        return box(x - half, y - half, x + half, y + half)

    def step(self, robot: Point) -> None:
        """Move on, unless a robot is near."""
        if self._rests > 0:
            self._rests -= BOX_STEP_S
            return
        left = math.dist(self.at, self._goal)
        way = BOX_SPEED * BOX_STEP_S
        if left <= way:
            draw = self._hall.random
            goal = (self.at[0] + draw.uniform(-4, 4), self.at[1] + draw.uniform(-4, 4))
            if self._hall.is_clear(self.at, goal, 0.45):
                self._goal, self._rests = goal, draw.uniform(1, 10)
            return
        share = way / left
        to = (self.at[0] + (self._goal[0] - self.at[0]) * share, self.at[1] + (self._goal[1] - self.at[1]) * share)
        if math.dist(to, robot) > max(RESPECT, min(math.dist(self.at, robot), RESPECT)):
            self.at = to
