"""Simulated places for the bench of navigation: walls, doors and crates that the map shows, and boxes that move, which
it does not.  The crates can be moved, too: the map shows them where they were."""

from __future__ import annotations

import math
import random
from typing import ClassVar

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
MOVED = (0.4, 2.0)
"""m by which a crate is moved."""
START: Pose = (2.0, 2.0, 0.0)


class Hall:
    """A hall of 20 by 20 m: walls and crates as the map shows them, and boxes that move.

    Attributes:
        shown: what the map shows.
        grid: the walls and the crates where they are.
        crates: the middles of the crates where they are.
    """

    size: ClassVar[Point] = (SIZE, SIZE)
    start: ClassVar[Pose] = START
    doors: ClassVar[tuple[Wall, ...]] = (
        (7, 0, 7, 5), (7, 6.5, 7, 14), (7, 15.5, 7, 20), (13, 0, 13, 3), (13, 4.5, 13, 11), (13, 12.5, 13, 20),
        (0, 10, 3, 10), (4.5, 10, 7, 10), (13, 9, 16, 9), (17.5, 9, 20, 9),
    )  # fmt: skip
    sides: ClassVar[tuple[float, ...]] = (CRATE,) * CRATES
    """m of each crate."""
    apart: ClassVar[tuple[float, float]] = (1.3, CRATE * 0.71 + 2 * RADIUS + 0.2)
    """m from the middle of a crate to a wall or to another crate, at first and when it is moved."""
    way: ClassVar[float] = 5.0
    """m from the robot to a goal, at least."""
    keeps = (RADIUS, RADIUS + 0.05, RADIUS + 0.1)
    """m from the walls of the ways of which the shortest counts."""

    def __init__(self, seed: int, boxes: int = BOXES) -> None:
        self.random = random.Random(seed)
        self.crates: list[Point] = []
        self._draw()
        for _ in self.sides:
            self.crates.append(self.place(self.apart[0]))
            self._draw()
        self.shown = self.walls()
        self.world = World(list(self.shown), self.start)
        self.boxes = [Box(self, self.place(0.8)) for _ in range(boxes)]

    def walls(self, without: int = -1) -> list[Wall]:
        """The walls, and the crates where they are, maybe without one."""
        walls = [*box(0, 0, *self.size), *self.doors]
        for number, ((x, y), side) in enumerate(zip(self.crates, self.sides, strict=False)):
            if number != without:
                walls += box(x - side / 2, y - side / 2, x + side / 2, y + side / 2)
        return walls

    def _draw(self, without: int = -1) -> None:
        self.grid = Grid(0, 0, *self.size, 0.1)
        for wall in self.walls(without):
            self.grid.block_line(*wall)

    def move_crates(self, count: int, robot: Point) -> None:
        """Move some of the crates by 0.4 to 2 m, away from the robot; the map stays."""
        for number in self.random.sample(range(len(self.crates)), count):
            x, y = self.crates[number]
            self._draw(without=number)
            while True:
                way, angle = self.random.uniform(*MOVED), self.random.uniform(-math.pi, math.pi)
                at = x + way * math.cos(angle), y + way * math.sin(angle)
                if math.inf > self.grid.distance(*at) >= self.apart[1] and math.dist(at, robot) > RESPECT + CRATE / 2:
                    break
            self.crates[number] = at
        self._draw()
        self.move_boxes(robot)

    def place(self, free: float) -> Point:
        """A random place at some distance from all that is there but the boxes, and from the start."""
        while True:
            at = self.random.uniform(0.5, self.size[0] - 0.5), self.random.uniform(0.5, self.size[1] - 0.5)
            if self.grid.distance(*at) >= free and math.dist(at, self.start[:2]) > 1.5:
                return at

    def is_clear(self, a: Point, b: Point, free: float) -> bool:
        """Whether a straight line keeps some distance from all that is there but the boxes."""
        shares = [step / 40 for step in range(41)]
        return all(self.grid.distance(a[0] + (b[0] - a[0]) * s, a[1] + (b[1] - a[1]) * s) >= free for s in shares)

    def move_boxes(self, robot: Point) -> None:
        """One step of all boxes."""
        walls = self.walls()
        for each in self.boxes:
            each.step(robot)
            walls += each.walls()
        self.world.walls[:] = walls


class Home(Hall):
    """A home of 10 by 8 m: five rooms with doors of 0.9 m, and ten pieces of furniture."""

    size = (10.0, 8.0)
    start = (1.0, 1.0, 0.0)
    doors = (
        (0, 4, 2.5, 4), (3.4, 4, 4, 4), (4, 0, 4, 1), (4, 1.9, 4, 5.5), (4, 6.4, 4, 8), (4, 3.5, 5, 3.5),
        (5.9, 3.5, 8.5, 3.5), (9.4, 3.5, 10, 3.5), (7, 3.5, 7, 6), (7, 6.9, 7, 8),
    )  # fmt: skip
    sides = (0.3, 0.4, 0.4, 0.4, 0.5, 0.5, 0.6, 0.6, 0.6, 0.7)
    apart = (0.6, 0.6)
    way = 3.0


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
