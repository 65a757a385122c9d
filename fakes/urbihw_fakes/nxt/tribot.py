"""A TriBot in front of a wall: the robot of LEGO's first building instructions.

    robot = TriBot()                      # 1.5 m before the wall
    robot.brick.telegram(...)             # drive
    robot.distance()                      # the distance for the ultrasonic sensor, in metres

Wheels on C (left) and A (right), claw on B; sound sensor on S1, ultrasonic on S2, light on S3, touch sensor on S4.  The
wall is the line x = 0; the robot starts at x = -1.5 and faces it.  At the wall the bumper is pressed, and the robot
stands while its wheels slip.
"""

from __future__ import annotations

import math

from urbihw_fakes.nxt.brick import Brick
from urbihw_fakes.nxt.inputs import Light, Sound, Touch
from urbihw_fakes.nxt.lowspeed import NO_ECHO, Ultrasonic

WHEEL_RADIUS = 0.028  # m, radius of the 56 mm tyre in the kit
TRACK = 0.112  # m between the wheels
START = 1.5  # m from the wall
BUMPER = 0.01  # m from the wall at which the bumper is pressed


class TriBot:
    """A brick with wheels, and its pose.

    Attributes:
        x, y: of the ultrasonic sensor, which is in front, in m; `heading` in rad, 0 towards the wall.
        slip: share of the wheels' rotation that is lost; the encoders do not show it.
        obstacle: metres to an object in front of the sensor; None for the wall only.
        pushed: the bumper is pressed by hand.
        pace: s after which it wants to move on without a request; None: it catches up when asked.
    """

    pace: float | None = None

    def __init__(self, distance: float = START) -> None:
        self.brick = Brick()
        self.x, self.y, self.heading = -distance, 0.0, 0.0
        self.slip = 0.0
        self.obstacle: float | None = None
        self.pushed = False
        self.sound, self.light, self.touch = Sound(), Light(), Touch()
        for port, thing in enumerate((self.sound, Ultrasonic(self._centimetres), self.light, self.touch)):
            self.brick.plug(port, thing)
        self.brick.around = self._move

    def distance(self) -> float:
        """Return the distance ahead in m; inf for nothing."""
        ahead = math.cos(self.heading)
        wall = -self.x / ahead if ahead > 0.1 else math.inf
        return wall if self.obstacle is None else min(wall, self.obstacle)

    def describe_place(self) -> str:
        """Where it is, in a few words."""
        return f"{-self.x * 100:.0f} cm before the wall, heading {math.degrees(self.heading):.0f}"

    def _centimetres(self) -> int:
        metres = self.distance()
        return NO_ECHO if metres > 2.5 else round(metres * 100)

    def _move(self, seconds: float) -> None:
        grip = WHEEL_RADIUS * (1 - self.slip)
        left, right = (math.radians(self.brick.motor(port).speed) * grip for port in "CA")
        ahead = (left + right) / 2 * seconds
        self.x += ahead * math.cos(self.heading)
        self.y += ahead * math.sin(self.heading)
        self.heading += (right - left) / TRACK * seconds
        self.x = min(self.x, 0.0)
        self.touch.pressed = self.pushed or self.distance() <= BUMPER
