"""Paths on a map for any base with a planner, in simulated time: what the labs and the tests of the platforms share."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

Pose = tuple[float, float, float]

HOME: Pose = (1.0, 1.0, 0.0)
"""Where the robot stands on the map when the map is named."""
ROOM = """2D-Map
Cairn: RobotHome 1000 1000 0 "" ICON "Home"
LINES
0 0 6000 0
6000 0 6000 4000
6000 4000 0 4000
0 4000 0 0
3000 0 3000 2500
"""
"""6 by 4 m, with a wall between home and what is right of it, to be passed at its upper end."""


def put_on_map(lab: Any, robot: str, folder: Path) -> None:
    """Let the planner of a robot (the slot of Global) read the room."""
    path = folder / "room.map"
    path.write_text(ROOM, "ascii")
    lab.look(f'{robot}.planner.mapFileName = "{path}"')
    for _ in range(3):
        lab.thought()
        lab.run(0.1)
    ready = lab.look(f"{robot}.planner.ready")
    assert ready == "true", (ready, lab.heard())


def on_map(robot: str) -> Callable[[Any, Path], None]:
    """The same for the contract of motion."""
    return lambda lab, folder: put_on_map(lab, robot, folder)


class Course:
    """Goals for a base; ``where`` says where its body truly is, in the frame in which it began at the origin."""

    def __init__(self, lab: Any, robot: str, where: Callable[[], Pose], folder: Path) -> None:
        self.lab, self.robot, self._where = lab, robot, where
        lab.say(f'at ({robot}.planner.pathPlanningEvent?(var how)) echo("path %s" % how);')
        put_on_map(lab, robot, folder)

    def begin(self, goal: str) -> None:
        """Name a goal, and let the path be planned."""
        self.lab.say(f"{self.robot}.moveTo({goal});")
        self.lab.thought()
        self.lab.run(0.1)

    def end(self, seconds: float = 90.0) -> str:
        """What is said until the path ends, and a second later."""
        until = self.lab.clock.now() + seconds
        said = ""
        while "path" not in said and "!!!" not in said:
            assert self.lab.clock.now() < until, "the path does not end"
            self.lab.thought()
            self.lab.run(0.2)
            said += self.lab.heard()
        self.lab.run(1.0)
        return said

    def drive(self, goal: str) -> str:
        """Name a goal, and wait until the path ends."""
        self.begin(goal)
        return self.end()

    def body(self) -> Pose:
        """Where the body truly is on the map."""
        x, y, heading = self._where()
        return HOME[0] + x, HOME[1] + y, heading

    def odometry(self) -> Pose:
        """Where the odometry says that it is on the map."""
        x, y, _, heading = (self.lab.number(f"{self.robot}.odometry.position[{index}]") for index in range(4))
        return x, y, heading

    def miss(self, goal: Pose) -> tuple[float, float]:
        """How far the body is from a goal: m, degrees."""
        x, y, heading = self.body()
        return math.dist((x, y), goal[:2]), abs(math.degrees(math.remainder(heading - goal[2], math.tau)))
