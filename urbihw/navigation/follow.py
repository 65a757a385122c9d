"""Drives along a planned path, and waits in front of obstacles; SI units, no I/O."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from urbihw.navigation.drive import BRAKING_SHARE, LATENCY_S, Limits, State
from urbihw.navigation.frames import Point, Pose, wrapped

LOOKAHEAD: Final = 0.35
"""Distance in m along the path to the point that the robot steers to."""
ARRIVED: Final = 0.06
"""Distance in m to the end of the path at which the robot has arrived."""
ARRIVED_TURN: Final = math.radians(3)
TURN_FIRST: Final = 0.7
"""Course error in rad above which the robot turns on the spot."""
STEERING_GAIN: Final = 1.6
STOP_DISTANCE: Final = 0.3
"""Distance in m to an obstacle ahead at which the robot waits until it is gone."""
BLOCKED_TIMEOUT_S: Final = 3.0
"""Seconds of waiting after which the path is blocked."""
STANDING: Final = 0.05
STANDING_TURN: Final = math.radians(4)
"""Speeds in m/s and rad/s below which the robot counts as standing at its goal."""


class PathFollower:
    """A motion along a path to a final heading.  ``pose()`` returns the pose of the robot, ``room()`` the free distance
    ahead.

    Attributes:
        blocked: the motion has ended because an obstacle stood in the way for too long.
    """

    safe = False

    def __init__(
        self, path: list[Point], heading: float, limits: Limits, pose: Callable[[], Pose], room: Callable[[], float]
    ) -> None:
        self.path = path
        self.blocked = False
        self._heading = heading
        self._limits = limits
        self._pose = pose
        self._room = room
        self._leg = 0
        self._turning_in = False
        self._waiting_since: float | None = None

    def speeds(self, state: State) -> tuple[float, float] | None:
        """Return the speeds towards the next point of the path, or of the final turn at its end."""
        x, y, heading = self._pose()
        end = self.path[-1]
        if self._turning_in or math.dist((x, y), end) <= ARRIVED:
            return self._turn_in(heading, state)
        target = self._target((x, y))
        off = wrapped(math.atan2(target[1] - y, target[0] - x) - heading)
        if abs(off) > TURN_FIRST:
            self._waiting_since = None
            return 0.0, self._turn(off, state.w)
        room = self._room()
        if room < min(STOP_DISTANCE, math.dist((x, y), end) + ARRIVED):
            return self._wait(state.time)
        self._waiting_since = None
        left = self._left((x, y))
        limits = self._limits
        free = max(0.0, min(left, room - STOP_DISTANCE / 2) - LATENCY_S * abs(state.v))
        braked = math.sqrt(2 * BRAKING_SHARE * limits.braking * free)
        v = max(limits.slowest, min(limits.cruise, limits.fastest, braked)) * math.cos(off)
        turn = min(limits.cruise_turn, limits.fastest_turn)
        return v, max(-turn, min(turn, STEERING_GAIN * off))

    def _turn_in(self, heading: float, state: State) -> tuple[float, float] | None:
        self._turning_in = True
        off = wrapped(self._heading - heading)
        if abs(off) <= ARRIVED_TURN:
            return None if abs(state.w) < STANDING_TURN and abs(state.v) < STANDING else (0.0, 0.0)
        return 0.0, self._turn(off, state.w)

    def _turn(self, off: float, w: float) -> float:
        limits = self._limits
        room = max(0.0, abs(off) - max(0.0, w * math.copysign(LATENCY_S, off)))
        fastest = min(limits.cruise_turn, limits.fastest_turn)
        braked = math.sqrt(2 * BRAKING_SHARE * limits.braking_turn * room)
        return math.copysign(max(limits.slowest_turn, min(fastest, braked)), off)

    def _wait(self, now: float) -> tuple[float, float] | None:
        if self._waiting_since is None:
            self._waiting_since = now
        if now - self._waiting_since < BLOCKED_TIMEOUT_S:
            return 0.0, 0.0
        self.blocked = True
        return None

    def _target(self, at: Point) -> Point:
        """The point to steer to: ``LOOKAHEAD`` further on the path, and never behind a segment that was passed."""
        path = self.path
        while self._leg < len(path) - 2 and _along(path[self._leg], path[self._leg + 1], at) >= 1.0:
            self._leg += 1
        a, b = path[self._leg], path[self._leg + 1]
        length = math.dist(a, b)
        ahead = max(0.0, min(1.0, _along(a, b, at))) * length + LOOKAHEAD
        leg = self._leg
        while ahead > length and leg < len(path) - 2:
            ahead -= length
            leg += 1
            a, b = path[leg], path[leg + 1]
            length = math.dist(a, b)
        share = min(1.0, ahead / length) if length else 1.0
        return a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share

    def _left(self, at: Point) -> float:
        """Distance in m to the end of the path."""
        path = self.path
        rest = sum(math.dist(path[i], path[i + 1]) for i in range(self._leg + 1, len(path) - 1))
        return math.dist(at, path[self._leg + 1]) + rest


def _along(a: Point, b: Point, at: Point) -> float:
    """The projection of a point on a line: 0 at its beginning, 1 at its end."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    return ((at[0] - a[0]) * dx + (at[1] - a[1]) * dy) / square if square else 1.0
