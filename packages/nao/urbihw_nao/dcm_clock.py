"""The clock of the robot's DCM (milliseconds, 32 bits), as seen from ours; no I/O.

A question about the time is answered some time after it was sent, and read even later.  The DCM's time minus ours at
the sending is therefore the offset plus the way to the robot; the least of the last samples is nearest to the offset.
"""

from __future__ import annotations

from collections import deque
from typing import Final

SAMPLES: Final = 16
"""How many of the last samples count."""
WRAP: Final = 1 << 32
"""Milliseconds after which the time of the DCM begins anew."""


class DcmClock:
    """The offset between the two clocks."""

    def __init__(self) -> None:
        self._offsets: deque[float] = deque(maxlen=SAMPLES)

    @property
    def known(self) -> bool:
        """Whether there is a sample."""
        return bool(self._offsets)

    def add_sample(self, sent: float, answer: int) -> None:
        """The DCM has answered ``answer`` (ms) to a question that was sent at a time of our clock (s)."""
        offset = answer - sent * 1000
        if self._offsets:
            # The same moment, some turns of its counter later.
            offset -= WRAP * round((offset - self._offsets[-1]) / WRAP)
        self._offsets.append(offset)

    def date(self, time: float) -> int:
        """The time of the DCM at a time of our clock (s): ms, 32 bits with a sign."""
        return (round(time * 1000 + min(self._offsets)) + WRAP // 2) % WRAP - WRAP // 2
