"""The wanted speeds of the two tracks, and when they are sent; no I/O.

Nothing is acknowledged and the firmware drives on by itself, so speeds are sent again and again, and a stop some times.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from urbihw.platforms.spykee import protocol as p

LEFT, RIGHT = "trackL", "trackR"
RESEND_PERIOD_S: Final = 0.2
"""Seconds between two packets of the same speeds."""
ZEROS: Final = 3
"""How often a standstill is sent."""


class TrackSpeeds:
    """Speeds by track, -100..100."""

    def __init__(self) -> None:
        self._speeds = {LEFT: 0, RIGHT: 0}
        self._due = 0.0
        self._left = 0

    @property
    def moving(self) -> bool:
        """Whether any track is to run."""
        return any(self._speeds.values())

    def set(self, track: str, speed: int) -> None:
        """A new speed, to be sent at once if it is another one."""
        if self._speeds[track] != speed:
            self._speeds[track] = speed
            self._due, self._left = 0.0, ZEROS

    def halt(self, tracks: Iterable[str] = (LEFT, RIGHT)) -> None:
        """Stand, and send it even if they stood before."""
        for track in tracks:
            self._speeds[track] = 0
        self._due, self._left = 0.0, ZEROS

    def forget(self) -> None:
        """Stand, with nobody to send it to."""
        self.halt()
        self._left = 0

    def packet(self, now: float) -> bytes | None:
        """What to send now, if anything."""
        if now < self._due or not (self.moving or self._left):
            return None
        self._due = now + RESEND_PERIOD_S
        self._left = max(0, self._left - 1)
        return p.move(self._speeds[LEFT], self._speeds[RIGHT])
