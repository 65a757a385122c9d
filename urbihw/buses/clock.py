"""Time as an argument: the two clocks a bus can run on.

Everything in `urbihw.buses` that needs to know or to wait for a time is handed a `BusClock`. The daemon hands out a
`BusRealClock`; tests hand out a `BusSimClock`, on which waiting is a jump, so that no test ever sleeps and every time
stamp is exact.
"""

from __future__ import annotations

import select
import time
from collections.abc import Sequence
from typing import Protocol

# A sleeping thread wakes 50 to 90 us late on Linux (timer slack); sleeping that much shorter meets the deadline.
_WAKE_UP_DELAY = 0.00005


class BusClock(Protocol):
    """The clock interface of the buses: seconds since an arbitrary origin, never decreasing."""

    def now(self) -> float:
        """Return the time in seconds."""
        ...

    def sleep_until(self, when: float) -> None:
        """Return at time `when`, or at once if it has passed."""
        ...

    def wait_readable(self, descriptors: Sequence[int], until: float) -> list[int]:
        """Return the descriptors that can be read as soon as there are some, or [] at time `until`."""
        ...


class BusRealClock:
    """The monotonic clock of the machine. It is the same in all processes, so time stamps can cross a pipe."""

    def __init__(self) -> None:
        # Bound as an instance attribute because this is called several times a transaction.
        self.now = time.monotonic

    def sleep_until(self, when: float) -> None:
        """Sleep (never spin) until `when`."""
        pause = when - time.monotonic() - _WAKE_UP_DELAY
        if pause > 0:
            time.sleep(pause)

    def wait_readable(self, descriptors: Sequence[int], until: float) -> list[int]:
        """Sleep in `select`, whose time-out is as fine as that of a sleep."""
        pause = max(0.0, until - time.monotonic() - _WAKE_UP_DELAY)
        return select.select(descriptors, (), (), pause)[0]


class BusSimClock:
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

    def wait_readable(self, descriptors: Sequence[int], until: float) -> list[int]:
        """Look now, and jump to `until` if there is nothing."""
        ready = select.select(descriptors, (), (), 0)[0]
        if not ready:
            self.sleep_until(until)
        return ready
