"""Time as an argument: the two clocks a bus can run on.

Everything in `urbihw.buses` that needs to know or to wait for a time is handed a `Clock`. The daemon hands out a
`RealClock`; tests hand out a `SimClock`, on which waiting is a jump, so that no test ever sleeps and every time stamp
is exact.
"""

from __future__ import annotations

import time
from typing import Protocol

# A sleeping thread wakes 50 to 90 us late on Linux (timer slack); going to bed that much earlier meets the deadline.
_WAKE_UP_DELAY = 0.00005


class Clock(Protocol):
    """What buses need of time: seconds on an arbitrary origin that never jumps back."""

    def now(self) -> float:
        """Return the time in seconds."""
        ...

    def sleep_until(self, when: float) -> None:
        """Return at time `when`, or at once if it has passed."""
        ...


class RealClock:
    """The monotonic clock of the machine. It is the same in all processes, so time stamps can cross a pipe."""

    def __init__(self) -> None:
        # Bound as an instance attribute because this is called several times a transaction.
        self.now = time.monotonic

    def sleep_until(self, when: float) -> None:
        """Sleep (never spin) until `when`."""
        pause = when - time.monotonic() - _WAKE_UP_DELAY
        if pause > 0:
            time.sleep(pause)


class SimClock:
    """A clock for tests: it stands still, and `sleep_until` moves it forward at once."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        """Return the simulated time in seconds."""
        return self._now

    def sleep_until(self, when: float) -> None:
        """Jump to `when` if it lies ahead."""
        if when > self._now:
            self._now = when
