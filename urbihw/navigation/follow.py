"""Drives along a planned path, and waits in front of obstacles; SI units, no I/O.

Where the path is narrow the robot drives slowly, goes to each corner before it turns, and steers aside from what its
sensors see beside it.
"""

from __future__ import annotations

import math
from typing import Final, Protocol

from urbihw.frozen import frozen
from urbihw.navigation.drive import BRAKING_SHARE, LATENCY_S, DriveLimits, State
from urbihw.navigation.frames import Point, Pose, wrapped

LOOKAHEAD: Final = 0.35
"""Distance in m along the path to the point that the robot steers to."""
ARRIVED: Final = 0.06
ARRIVED_TURN: Final = math.radians(3)
"""Distance in m to the end of the path, and to the heading there, at which the robot stops at the latest."""
ARRIVED_SHARE: Final = 0.6
"""Share of a tolerance at which it stops; the rest is for the way until it stands."""
TURN_FIRST: Final = 0.7
"""Course error in rad above which the robot turns on the spot."""
ALIGNED: Final = 0.15
"""Course error in rad below which an obstacle ahead is one on the path."""
STEERING_GAIN: Final = 1.6
STOP_DISTANCE: Final = 0.3
"""Distance in m to an obstacle ahead at which the robot waits until it is gone."""
BLOCKED_TIMEOUT_S: Final = 3.0
"""Seconds of waiting after which the path is blocked."""
NARROW_SPEED: Final = 0.12
"""m/s on the narrow parts of a path."""
NARROW_LOOKAHEAD, NARROW_STOP_DISTANCE = 0.2, 0.08
"""As LOOKAHEAD and STOP_DISTANCE, there."""
NARROW_TURN: Final = 0.12
"""Course error in rad above which the robot turns on the spot there."""
NARROW_MARGIN, STUCK_MARGIN = -0.01, 0.03
"""m beside what paths want: a way with less room is narrow, and one with less than the second if the robot cannot go on
as where it is wide."""
NARROW_BEFORE, NARROW_AHEAD = 0.4, 0.7
"""m of the path behind and ahead of the robot that make it narrow."""
EVASIONS: Final = (0.0, 0.05, -0.05, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
"""rad/s added to the yaw rate there, of which the first is taken that leaves the way ahead free."""
STANDING: Final = 0.05
STANDING_TURN: Final = math.radians(4)
"""Speeds in m/s and rad/s below which the robot counts as standing at its goal."""


@frozen
class Tolerance:
    """How far from its goal the robot may stand: m and rad."""

    distance: float = 0.1
    heading: float = math.radians(5)

    def allows(self, pose: Pose, place: Point, heading: float) -> bool:
        """Whether a pose is near enough to a place and a heading."""
        return math.dist(pose[:2], place) <= self.distance and abs(wrapped(heading - pose[2])) <= self.heading


class PathView(Protocol):
    """What the robot sees and knows of its way; ``navigation.view.NavigatorView`` is one."""

    def pose(self) -> Pose:
        """Where it is on the map."""
        ...

    def fastest(self) -> float:
        """The most speed in m/s that is allowed now."""
        ...

    def free_way(self, curvature: float, narrow: bool) -> float:
        """Free distance in m ahead along an arc (1/m)."""
        ...

    def is_narrow(self, a: Point, b: Point, margin: float) -> bool:
        """Whether walls and known obstacles leave less room beside a line than paths want and a margin in m."""
        ...


class PathFollower:
    """A motion along a path to a final heading.

    Attributes:
        blocked: the motion has ended because an obstacle stood in the way for too long.
    """

    safe = False

    def __init__(
        self,
        path: list[Point],
        heading: float,
        limits: DriveLimits,
        view: PathView,
        tolerance: Tolerance,
    ) -> None:
        self.path = path
        self.blocked = False
        self._heading = heading
        self._limits = limits
        self._view = view
        self._arrived = min(ARRIVED, ARRIVED_SHARE * tolerance.distance)
        self._arrived_turn = min(ARRIVED_TURN, ARRIVED_SHARE * tolerance.heading)
        self._leg = 0
        self._turning_in = self._is_stuck = False
        self._waiting_since: float | None = None

    def change_path(self, path: list[Point]) -> None:
        """Go on along another path to the same goal, which begins where the robot is."""
        self.path = path
        self._leg = 0
        self._waiting_since = None

    def rest(self) -> list[Point]:
        """The rest of the path, from the robot on."""
        x, y, _ = self._view.pose()
        return [(x, y), *self.path[self._leg + 1 :]]

    def speeds(self, state: State) -> tuple[float, float] | None:
        """Return the speeds towards the next point of the path, or of the final turn at its end."""
        x, y, heading = self._view.pose()
        limits = self._limits
        end = self.path[-1]
        if self._turning_in or math.dist((x, y), end) <= self._arrived:
            return self._turn_in(heading, state)
        self._pass_corners((x, y))
        self._is_stuck = self._is_stuck and self._is_narrow((x, y), STUCK_MARGIN)
        narrow = self._is_stuck or self._is_narrow((x, y), NARROW_MARGIN)
        target = self._target((x, y), narrow)
        off = wrapped(math.atan2(target[1] - y, target[0] - x) - heading)
        if abs(off) > (NARROW_TURN if narrow else TURN_FIRST):
            self._waiting_since = None
            return 0.0, self._turn(off, state.w)
        turn = min(limits.cruise_turn, limits.fastest_turn)
        fastest = min(limits.cruise, limits.fastest, self._view.fastest(), NARROW_SPEED if narrow else math.inf)
        cruise = fastest * math.cos(off)
        w, room = self._steer(max(-turn, min(turn, STEERING_GAIN * off)), cruise, narrow)
        stop = NARROW_STOP_DISTANCE if narrow else STOP_DISTANCE
        if room < min(stop, math.dist((x, y), end) + self._arrived):
            if not narrow and self._is_narrow((x, y), STUCK_MARGIN):
                self._is_stuck = True
                return self.speeds(state)
            # An arc may touch what the path beside it leaves free; a round hull can turn on the spot.
            return self._wait(state.time) if abs(off) < ALIGNED else (0.0, self._turn(off, state.w))
        self._waiting_since = None
        free = max(0.0, min(self._left((x, y), narrow), room - stop / 2) - LATENCY_S * abs(state.v))
        braked = math.sqrt(2 * BRAKING_SHARE * limits.braking * free)
        return max(limits.slowest, min(cruise, braked * math.cos(off))), w

    def _steer(self, w: float, v: float, narrow: bool) -> tuple[float, float]:
        """The yaw rate nearest to a wanted one that leaves the way free, or the wanted one; and the free way."""
        first = room = self._view.free_way(w / v, narrow)
        if narrow and room < NARROW_STOP_DISTANCE:
            for evasion in EVASIONS[1:]:
                room = self._view.free_way((w + evasion) / v, narrow)
                if room >= NARROW_STOP_DISTANCE:
                    return w + evasion, room
        return w, first

    def _turn_in(self, heading: float, state: State) -> tuple[float, float] | None:
        self._turning_in = True
        off = wrapped(self._heading - heading)
        if abs(off) <= self._arrived_turn:
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

    def _pass_corners(self, at: Point) -> None:
        """Go on to the next line of the path when the robot has passed the end of the one before."""
        path = self.path
        while self._leg < len(path) - 2 and _along(path[self._leg], path[self._leg + 1], at) >= 1.0:
            self._leg += 1

    def _is_narrow(self, at: Point, margin: float) -> bool:
        """Whether the path is narrow near the robot, with a margin in m."""
        path, leg = self.path, self._leg
        a, b = path[leg], path[leg + 1]
        length = math.dist(a, b)
        done = max(0.0, min(1.0, _along(a, b, at))) * length
        first, last = max(0.0, done - NARROW_BEFORE), done + NARROW_AHEAD
        while True:
            ends = [_between(a, b, share / length) for share in (first, min(last, length))] if length else []
            if ends and self._view.is_narrow(ends[0], ends[1], margin):
                return True
            leg += 1
            first, last = 0.0, last - length
            if last <= 0 or leg > len(path) - 2:
                return False
            a, b = path[leg], path[leg + 1]
            length = math.dist(a, b)

    def _target(self, at: Point, narrow: bool) -> Point:
        """The point to steer to: some way further on the path, and where that is narrow on its line, even beyond the
        next corner."""
        path = self.path
        a, b = path[self._leg], path[self._leg + 1]
        length = math.dist(a, b)
        ahead = max(0.0, min(1.0, _along(a, b, at))) * length + (NARROW_LOOKAHEAD if narrow else LOOKAHEAD)
        leg = self._leg
        while ahead > length and leg < len(path) - 2 and not narrow:
            ahead -= length
            leg += 1
            a, b = path[leg], path[leg + 1]
            length = math.dist(a, b)
        if not length:
            return b
        return _between(a, b, ahead / length if leg < len(path) - 2 else min(1.0, ahead / length))

    def _left(self, at: Point, narrow: bool) -> float:
        """Distance in m to the end of the path, and where that is narrow to the next corner."""
        path = self.path
        rest = sum(math.dist(path[i], path[i + 1]) for i in range(self._leg + 1, len(path) - 1))
        return math.dist(at, path[self._leg + 1]) + (0.0 if narrow else rest)


def _between(a: Point, b: Point, share: float) -> Point:
    """A point on a line: ``a`` at 0, ``b`` at 1."""
    return a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share


def _along(a: Point, b: Point, at: Point) -> float:
    """The projection of a point on a line: 0 at its beginning, 1 at its end."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    return ((at[0] - a[0]) * dx + (at[1] - a[1]) * dy) / square if square else 1.0
