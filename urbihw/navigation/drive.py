"""How fast the robot shall go: speeds as set, or a motion that decides about them, and room to keep; no I/O, SI units.

``Drive.step`` is asked with each packet of the robot (ten times a second) and whenever something was set.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

LATENCY_S: Final = 0.2
"""Seconds from a position that was measured until the speed that follows from it is reached: two packets."""
STALL_TIMEOUT_S: Final = 1.0
"""Seconds of stalling after which a motion is given up."""
BRAKING_SHARE: Final = 0.7
"""Share of the deceleration that is counted with."""

FINISHED, STALLED = "finished", "stalled"


@dataclass(frozen=True, slots=True)
class State:
    """What is known of the robot at one moment.

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
class Limits:
    """What the robot can do, and how fast it goes when only a distance was said."""

    fastest: float = 0.75
    fastest_turn: float = math.radians(100)
    braking: float = 0.3
    braking_turn: float = math.radians(100)
    cruise: float = 0.3
    cruise_turn: float = 0.7


@dataclass(slots=True)
class Safety:
    """Room to keep: nearer than ``least`` nothing moves towards an obstacle, farther than ``most`` it is free."""

    least: float = 0.0
    most: float = 0.0

    def limited_speed(self, v: float, state: State) -> float:
        """The speed that is allowed."""
        room = state.front if v > 0 else state.rear
        if not v or room >= max(self.most, self.least):
            return v
        if room <= self.least:
            return 0.0
        return v * (room - self.least) / (self.most - self.least)


class Motion(Protocol):
    """What decides about the speeds for some time."""

    safe: bool
    """Whether the safety distances count for it."""

    def speeds(self, state: State) -> tuple[float, float] | None:
        """The speeds, m/s and rad/s; None when it is over."""
        ...


class Drive:
    """Holds what the robot shall do; ``ended(motion, how)`` is told when a motion is over: FINISHED, STALLED or why.

    Attributes:
        limits, safety: see there.
        motion: what is under way, None while only speeds are set.
        v, w: the speeds as set.
    """

    def __init__(self, ended: Callable[[Motion, str], None]) -> None:
        self.limits = Limits()
        self.safety = Safety()
        self.motion: Motion | None = None
        self.v = self.w = 0.0
        self._ended = ended
        self._stalled_at: float | None = None

    def start(self, motion: Motion) -> None:
        """Begin a motion; one that is under way is over."""
        self.end("another motion began")
        self.v = self.w = 0.0
        self._stalled_at = None
        self.motion = motion

    def set(self, v: float | None = None, w: float | None = None) -> None:
        """Set one speed or both; a motion that is under way is over."""
        self.end("a speed was set")
        if v is not None:
            self.v = max(-self.limits.fastest, min(self.limits.fastest, v))
        if w is not None:
            self.w = max(-self.limits.fastest_turn, min(self.limits.fastest_turn, w))

    def halt(self, why: str = "stopped") -> None:
        """Nothing shall move any more."""
        self.v = self.w = 0.0
        self.end(why)

    def end(self, how: str) -> None:
        """The motion is over, if there is one."""
        motion, self.motion = self.motion, None
        if motion is not None:
            self._ended(motion, how)

    def step(self, state: State) -> tuple[float, float]:
        """The speeds to order now."""
        motion = self.motion
        if motion is None:
            return self.safety.limited_speed(self.v, state), self.w
        if self._gives_up(state):
            self.end(STALLED)
            return 0.0, 0.0
        speeds = motion.speeds(state)
        if speeds is None:
            # It may have begun another motion meanwhile.
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
