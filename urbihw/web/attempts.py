"""Wrong pairing codes: each is answered later than the one before it.

A right code is never held up, so wrong ones do not keep others out.  The codes are too long to be guessed (96
bits); this keeps those who try from costing much, and from being overlooked.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

FIRST_S: Final = 0.25
"""Seconds for which the first answer waits; each further one twice as long."""
MAX_S: Final = 8.0
FORGET_S: Final = 300.0
"""Seconds after the last wrong code after which an address begins anew."""
MAX_ADDRESSES: Final = 256
"""Addresses that are counted; the one that has been quiet for longest makes room."""


class Attempts:
    """Counts wrong codes by address."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._failed: dict[str, tuple[int, float]] = {}  # the address that failed last stands last

    def fail(self, address: str) -> float:
        """Count a wrong code; the seconds for which its answer waits."""
        count, last = self._failed.pop(address, (0, 0.0))
        now = self._now()
        if now - last > FORGET_S:
            count = 0
        if len(self._failed) >= MAX_ADDRESSES:
            del self._failed[next(iter(self._failed))]
        self._failed[address] = count + 1, now
        return min(MAX_S, FIRST_S * 2.0 ** min(count, 30))

    def succeed(self, address: str) -> None:
        """Forget the wrong codes of an address."""
        self._failed.pop(address, None)
