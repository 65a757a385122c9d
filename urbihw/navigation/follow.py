"""Driving along a planned path, and waiting before what is in the way; SI units, no I/O."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from urbihw.navigation.drive import BRAKING_SHARE, LATENCY_S, Limits, State
from urbihw.navigation.frames import Point, Pose, wrapped

AHEAD: Final = 0.35
"""m along the path to the point that the robot heads for."""
ARRIVED: Final = 0.06
"""m from the end of the path at which the robot has arrived."""
ARRIVED_TURN: Final = math.radians(3)
TURN_FIRST: Final = 0.7
"""rad off course beyond which the robot turns on the spot."""
STEER: Final = 1.6
STOP_DISTANCE: Final = 0.3
"""m to something ahead at which the robot waits for it to go away."""
BLOCKED_TIMEOUT_S: Final = 3.0
"""Seconds it waits."""
SLOW: Final = 0.05
SLOW_TURN: Final = math.radians(4)


class PathFollower:
    """A motion along a path to a heading; ``pose()`` says where the robot is, ``room()`` how far it is free ahead.

    Attributes:
        blocked: it ended because something stood in the way for too long.
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
        """See ``drive.Motion``."""
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
        v = max(SLOW, min(limits.cruise, limits.fastest, braked)) * math.cos(off)
        return v, max(-limits.cruise_turn, min(limits.cruise_turn, STEER * off))

    def _turn_in(self, heading: float, state: State) -> tuple[float, float] | None:
        self._turning_in = True
        off = wrapped(self._heading - heading)
        if abs(off) <= ARRIVED_TURN:
            return None if abs(state.w) < SLOW_TURN and abs(state.v) < SLOW else (0.0, 0.0)
        return 0.0, self._turn(off, state.w)

    def _turn(self, off: float, w: float) -> float:
        limits = self._limits
        room = max(0.0, abs(off) - max(0.0, w * math.copysign(LATENCY_S, off)))
        fastest = min(limits.cruise_turn, limits.fastest_turn)
        braked = math.sqrt(2 * BRAKING_SHARE * limits.braking_turn * room)
        return math.copysign(max(SLOW_TURN, min(fastest, braked)), off)

    def _wait(self, now: float) -> tuple[float, float] | None:
        if self._waiting_since is None:
            self._waiting_since = now
        if now - self._waiting_since < BLOCKED_TIMEOUT_S:
            return 0.0, 0.0
        self.blocked = True
        return None

    def _target(self, at: Point) -> Point:
        """The point to head for: some way ahead on the path, and never behind what was passed."""
        path = self.path
        while self._leg < len(path) - 2 and _along(path[self._leg], path[self._leg + 1], at) >= 1.0:
            self._leg += 1
        a, b = path[self._leg], path[self._leg + 1]
        length = math.dist(a, b)
        ahead = max(0.0, min(1.0, _along(a, b, at))) * length + AHEAD
        leg = self._leg
        while ahead > length and leg < len(path) - 2:
            ahead -= length
            leg += 1
            a, b = path[leg], path[leg + 1]
            length = math.dist(a, b)
        share = min(1.0, ahead / length) if length else 1.0
        return a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share

    def _left(self, at: Point) -> float:
        """m to the end of the path."""
        path = self.path
        rest = sum(math.dist(path[i], path[i + 1]) for i in range(self._leg + 1, len(path) - 1))
        return math.dist(at, path[self._leg + 1]) + rest


def _along(a: Point, b: Point, at: Point) -> float:
    """Where a point lies beside a line: 0 at its beginning, 1 at its end."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    return ((at[0] - a[0]) * dx + (at[1] - a[1]) * dy) / square if square else 1.0
