"""The wanted speeds of the two tracks, and when they are sent; no I/O.

The robot acknowledges nothing, and its firmware drives on by itself: speeds are sent periodically, a stop several
times.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from urbihw.platforms.spykee import protocol as p

LEFT, RIGHT = "trackL", "trackR"
RESEND_PERIOD_S: Final = 0.2
"""Seconds between two packets of the same speeds."""
ZEROS: Final = 3
"""Number of packets that are sent for a stop."""


class TrackSpeeds:
    """Speeds by track, -100..100."""

    def __init__(self) -> None:
        self._speeds = {LEFT: 0, RIGHT: 0}
        self._due = 0.0
        self._left = 0

    @property
    def moving(self) -> bool:
        """Whether a track has a speed other than 0."""
        return any(self._speeds.values())

    def set_speed(self, track: str, speed: int) -> None:
        """Set a speed; a changed one is sent with the next packet, and 0 always: somebody else may drive it."""
        if self._speeds[track] != speed:
            self._speeds[track], self._due = speed, 0.0
        elif speed:
            return
        self._left = ZEROS

    def halt(self, tracks: Iterable[str] = (LEFT, RIGHT)) -> None:
        """Set the speeds of tracks to 0, and send that even if they were 0 before."""
        for track in tracks:
            self._speeds[track] = 0
        self._due, self._left = 0.0, ZEROS

    def reset(self) -> None:
        """Set the speeds to 0 without sending them."""
        self.halt()
        self._left = 0

    def next_packet(self, now: float) -> bytes | None:
        """The packet to send at this time; None if none is due."""
        if now < self._due or not (self.moving or self._left):
            return None
        self._due = now + RESEND_PERIOD_S
        self._left = max(0, self._left - 1)
        return p.move(self._speeds[LEFT], self._speeds[RIGHT])
