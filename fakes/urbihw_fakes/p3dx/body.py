"""How the robot moves: two wheels, what is wanted of them, the walls in the way, and what the robot believes of it.

The truth (``pose``) and the odometry part company: of every turn of the wheels, the share ``slip`` moves nothing.
Units are m, rad, s.  Nothing here knows bytes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from urbihw_fakes.p3dx.world import Pose, World

STEP = 0.01
LONGEST_GAP = 10.0
RADIUS = 0.25
HALF_TRACK = 0.1786
BUMPERS = 5
BUMPER_ARC = math.radians(34)
CHARGED = 12.5
DRAIN_RESTING, DRAIN_MOVING = 0.00002, 0.0002


@dataclass
class Axis:
    """Translation or rotation: what is wanted, how fast it is, and how hard it may change.

    ``goal`` is how far it still has to go, None while a speed is wanted.
    """

    most: float
    faster: float
    slower: float
    wanted: float = 0.0
    goal: float | None = None
    speed: float = 0.0

    def set_speed(self, speed: float) -> None:
        """Set the wanted speed."""
        self.goal, self.wanted = None, max(-self.most, min(self.most, speed))

    def set_distance(self, distance: float) -> None:
        """Move by a distance, then stand still."""
        self.goal = distance

    def step(self, dt: float, *, allowed: bool) -> float:
        """Advance by ``dt`` seconds; return the distance."""
        aim = self._target_speed() if allowed else 0.0
        braking = abs(aim) < abs(self.speed) or aim * self.speed < 0
        change = (self.slower if braking else self.faster) * dt
        self.speed += max(-change, min(change, aim - self.speed))
        way = self.speed * dt
        if self.goal is not None and allowed:
            if abs(self.goal) <= abs(way) + 1e-4 and aim * self.goal >= 0:
                way, self.speed, self.wanted = self.goal, 0.0, 0.0
                self.goal = None
            else:
                self.goal -= way
        return way

    def _target_speed(self) -> float:
        if self.goal is None:
            return self.wanted
        return math.copysign(min(self.most, math.sqrt(2 * self.slower * 0.8 * abs(self.goal)) + 0.002), self.goal)

    def halt(self) -> None:
        """Stop the axis at once."""
        self.wanted = self.speed = 0.0
        self.goal = None


class Body:
    """The robot in its world.

    Attributes:
        pose: where it truly is; odometry: where it believes to be.
        motors: they are on. halted: the watchdog holds it; what was wanted is kept.
        slip: share of the wheels' turning that moves nothing.
        stalled: (left, right). front, rear: which bumpers are pressed, as sets of numbers from the left.
        left_way, right_way: m that the wheels have turned.
        bump_stall: 0 bumpers stop nothing, 1 front, 2 rear, 3 both.
    """

    def __init__(self, world: World, slip: float = 0.01) -> None:
        self.world = world
        self.pose: Pose = world.home
        self.odometry: Pose = (0.0, 0.0, 0.0)
        self.slip = slip
        self.motors = False
        self.halted = False
        self.volts = CHARGED
        self.bump_stall = 3
        self.stalled = (False, False)
        self.front: set[int] = set()
        self.rear: set[int] = set()
        self.left_way = self.right_way = 0.0
        self.forward = Axis(0.75, 0.3, 0.3)
        self.turning = Axis(math.radians(100), math.radians(100), math.radians(100))
        self._now: float | None = None

    @property
    def wheels(self) -> tuple[float, float]:
        """Speeds of the left and of the right wheel, m/s."""
        spread = self.turning.speed * HALF_TRACK
        return self.forward.speed - spread, self.forward.speed + spread

    @property
    def moving(self) -> bool:
        """Whether the robot moves."""
        return abs(self.forward.speed) > 1e-4 or abs(self.turning.speed) > 1e-4

    @property
    def turn_rate(self) -> float:
        """How fast the body truly turns: rad/s."""
        return self.turning.speed * (1 - self.slip)

    def stop(self) -> None:
        """Brake; the motors stay on."""
        self.forward.set_speed(0.0)
        self.turning.set_speed(0.0)

    def switch_motors(self, on: bool) -> None:
        """Switch the motors; wanted speeds and distances are dropped."""
        self.motors = on
        self.stop()

    def advance(self, now: float) -> None:
        """Advance to ``now``."""
        if self._now is None or now - self._now > LONGEST_GAP:
            # After a long pause of the caller the watchdog has stopped the robot.
            self._now = now
        while self._now + STEP <= now + 1e-9:
            self._now += STEP
            self._step(STEP)

    def set_pose(self, x: float, y: float, heading: float) -> None:
        """Move the body to a pose without changing its odometry."""
        self.pose = (x, y, heading)

    def _step(self, dt: float) -> None:
        allowed = self.motors and not self.halted
        way = self.forward.step(dt, allowed=allowed)
        angle = self.turning.step(dt, allowed=allowed)
        self._drain(dt)
        if not way and not angle:
            self._press_bumpers(0.0)
            return
        x, y, heading = self.pose
        middle = heading + angle * (1 - self.slip) / 2
        real = way * (1 - self.slip)
        to = (x + real * math.cos(middle), y + real * math.sin(middle))
        if self._blocked(*to, way):
            self.forward.speed = way = 0.0
            to = (x, y)
        self.pose = (*to, _turned(heading, angle * (1 - self.slip)))
        self._update_odometry(way, angle)

    def _drain(self, dt: float) -> None:
        self.volts = max(0.0, self.volts - dt * (DRAIN_MOVING if self.moving else DRAIN_RESTING))

    def _blocked(self, x: float, y: float, way: float) -> bool:
        distance, direction = self.world.nearest(x, y)
        # Only what lies ahead blocks: it can always back away.
        ahead = math.cos(direction - self.pose[2]) * way > 0
        hit = distance < RADIUS and ahead
        if hit:
            self._press_bumpers(way)
            if (self.bump_stall & 1 and self.front and way > 0) or (self.bump_stall & 2 and self.rear and way < 0):
                self.forward.goal = None
        else:
            self.stalled = (False, False)
            if distance > RADIUS + 0.01:
                self.front, self.rear = set(), set()
        return hit

    def _press_bumpers(self, way: float) -> None:
        """Press the bumpers at the nearest wall; the wheels stall while they push against it."""
        distance, direction = self.world.nearest(*self.pose[:2])
        self.front, self.rear = set(), set()
        pushing = self.forward.goal or self.forward.wanted if self.motors and not self.halted else 0.0
        if distance >= RADIUS + 0.01:
            self.stalled = (False, False)
            return
        side = _turned(0.0, direction - self.pose[2])
        (self.front if abs(side) <= math.pi / 2 else self.rear).add(_bumper(side))
        self.stalled = (math.cos(side) * (way or pushing) > 1e-9,) * 2

    def _update_odometry(self, way: float, angle: float) -> None:
        x, y, heading = self.odometry
        middle = heading + angle / 2
        self.odometry = (x + way * math.cos(middle), y + way * math.sin(middle), _turned(heading, angle))
        self.left_way += way - angle * HALF_TRACK
        self.right_way += way + angle * HALF_TRACK


def _turned(heading: float, angle: float) -> float:
    """A heading after a turn, from -pi to pi."""
    return (heading + angle + math.pi) % (2 * math.pi) - math.pi


def _bumper(side: float) -> int:
    """Return the number, from the left, of the bumper on this side."""
    ahead = side if abs(side) <= math.pi / 2 else math.pi - side
    number = BUMPERS // 2 - round(_turned(0.0, ahead) / BUMPER_ARC)
    return max(0, min(BUMPERS - 1, number))
