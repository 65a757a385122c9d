"""Computes the speeds of the robot: fixed speeds or those of a motion, within safety distances; no I/O, SI units.

``Drive.step`` is called for each packet of the robot (ten times a second) and after each new target.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

from urbihw.frozen import frozen

LATENCY_S: Final = 0.2
"""Seconds from the measurement of a position until the robot has the speed computed from it: two packets."""
STALL_TIMEOUT_S: Final = 1.0
"""Seconds of stalling after which a motion is given up."""
BRAKING_SHARE: Final = 0.7
"""Share of the deceleration that braking distances assume."""

FINISHED, STALLED = "finished", "stalled"


@frozen
class State:
    """The state of the robot at one moment.

    Attributes:
        v, w: speeds, m/s and rad/s.
        front, rear: m to the nearest obstacle, inf if there is none.
        stalled: the wheels are blocked.
    """

    time: float
    v: float
    w: float
    front: float = math.inf
    rear: float = math.inf
    stalled: bool = False


@dataclass(slots=True)
class DriveLimits:
    """The limits of the robot, and the speeds of motions without a given speed; m/s, rad/s, m/s2, rad/s2.

    Attributes:
        fastest, fastest_turn: maximum speeds.
        slowest, slowest_turn: minimum speeds at which the robot still moves; a motion ends with them.
        braking, braking_turn: guaranteed decelerations.
        cruise, cruise_turn: speeds of a motion without a given speed.
    """

    fastest: float = 0.75
    fastest_turn: float = math.radians(100)
    braking: float = 0.3
    braking_turn: float = math.radians(100)
    slowest: float = 0.05
    slowest_turn: float = math.radians(4)
    cruise: float = 0.3
    cruise_turn: float = 0.7


@dataclass(slots=True)
class Safety:
    """Safety distances in m: nearer to an obstacle than ``least`` the robot does not move towards it, farther than
    ``most`` the speed is not limited."""

    least: float = 0.0
    most: float = 0.0

    def limited_speed(self, v: float, state: State) -> float:
        """The allowed speed, m/s."""
        room = state.front if v > 0 else state.rear
        if not v or room >= max(self.most, self.least):
            return v
        if room <= self.least:
            return 0.0
        return v * (room - self.least) / (self.most - self.least)


class DriveMotion(Protocol):
    """Computes the speeds until its end."""

    safe: bool
    """Whether the safety distances limit the motion."""

    def speeds(self, state: State) -> tuple[float, float] | None:
        """The speeds, m/s and rad/s; None when the motion has ended."""
        ...


class Drive:
    """The target speeds or the motion of the robot.  ``ended(motion, how)`` is called at the end of a motion; ``how``
    is FINISHED, STALLED or another reason.

    Attributes:
        limits, safety: the limits of the robot and its safety distances.
        motion: the current motion; None while the robot drives at fixed speeds.
        v, w: the fixed speeds, m/s and rad/s.
    """

    def __init__(self, ended: Callable[[DriveMotion, str], None]) -> None:
        self.limits = DriveLimits()
        self.safety = Safety()
        self.motion: DriveMotion | None = None
        self.v = self.w = 0.0
        self._ended = ended
        self._stalled_at: float | None = None

    @property
    def is_driving(self) -> bool:
        """Whether a fixed speed is not 0."""
        return self.v != 0 or self.w != 0

    def start(self, motion: DriveMotion) -> None:
        """Begin a motion; the current one is ended."""
        self.end("another motion began")
        self.v = self.w = 0.0
        self._stalled_at = None
        self.motion = motion

    def set(self, v: float | None = None, w: float | None = None) -> None:
        """Set one or both fixed speeds; the current motion is ended."""
        self.end("a speed was set")
        old = self.v, self.w
        if v is not None:
            self.v = max(-self.limits.fastest, min(self.limits.fastest, v))
        if w is not None:
            self.w = max(-self.limits.fastest_turn, min(self.limits.fastest_turn, w))
        if any(new * before <= 0 and new != before for new, before in zip((self.v, self.w), old, strict=True)):
            # Another direction: the wheels may be free that way.
            self._stalled_at = None

    def halt(self, why: str = "stopped") -> None:
        """Set both speeds to 0; the current motion is ended."""
        self.v = self.w = 0.0
        self.end(why)

    def end(self, how: str) -> None:
        """End the current motion, if there is one."""
        motion, self.motion = self.motion, None
        if motion is not None:
            self._ended(motion, how)

    def step(self, state: State) -> tuple[float, float]:
        """The speeds to order now; fixed speeds are set to 0 once the wheels have been blocked for STALL_TIMEOUT_S."""
        motion = self.motion
        if (motion is not None or self.is_driving) and self._gives_up(state):
            self.halt(STALLED)
            return 0.0, 0.0
        if motion is None:
            return self.safety.limited_speed(self.v, state), self.w
        speeds = motion.speeds(state)
        if speeds is None:
            # The callback may have begun another motion.
            if self.motion is motion:
                self.end(FINISHED)
            return 0.0, 0.0
        v, w = speeds
        return (self.safety.limited_speed(v, state) if motion.safe else v), w

    def _gives_up(self, state: State) -> bool:
        if not state.stalled:
            self._stalled_at = None
            return False
        if self._stalled_at is None:
            self._stalled_at = state.time
        return state.time - self._stalled_at >= STALL_TIMEOUT_S
