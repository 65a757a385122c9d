"""The gripper: paddles and a lift that run until their end switches; it starts closed and down.

Source: the ARCOS chapter of the Pioneer 3 manual (command 33, the byte GRIP_STATE of the SIP).
"""

from __future__ import annotations

from dataclasses import dataclass, field

PADDLES_S = 1.5
LIFT_S = 3.0
"""Seconds from one end to the other."""
AT_TOP, AT_BOTTOM, MOVING = 1, 2, 4


@dataclass
class Slide:
    """Something between two ends: ``place`` from 0 to 1, ``way`` -1, 0 or 1, ``seconds`` from end to end."""

    seconds: float
    place: float = 0.0
    way: int = 0

    def advance(self, dt: float) -> None:
        """Move for some seconds; the end switch stops it."""
        self.place = max(0.0, min(1.0, self.place + self.way * dt / self.seconds))
        if self.place == (self.way > 0):
            self.way = 0

    @property
    def state(self) -> int:
        """Its bits in GRIP_STATE."""
        return (AT_TOP if self.place == 1 else AT_BOTTOM if self.place == 0 else 0) | (MOVING if self.way else 0)


@dataclass
class Gripper:
    """The paddles (1 is open) and the lift (1 is up)."""

    paddles: Slide = field(default_factory=lambda: Slide(PADDLES_S))
    lift: Slide = field(default_factory=lambda: Slide(LIFT_S))

    def act(self, code: int) -> None:
        """Execute the argument of GRIPPER; unknown ones do nothing."""
        ways = {1: (1, None), 2: (-1, None), 3: (0, None), 4: (None, 1), 5: (None, -1), 6: (None, 0),
                7: (-1, 1), 8: (1, -1), 15: (0, 0)}.get(code, (None, None))  # fmt: skip
        for slide, way in zip((self.paddles, self.lift), ways, strict=True):
            if way is not None:
                slide.way = way

    def advance(self, dt: float) -> None:
        """Move for some seconds."""
        self.paddles.advance(dt)
        self.lift.advance(dt)

    @property
    def state(self) -> int:
        """The state byte of the gripper (GRIP_STATE)."""
        return self.paddles.state | self.lift.state << 4
