"""Clocks.  The scheduler is handed one; nobody else asks the time."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Seconds since the kernel started, never going back."""

    def now(self) -> float:
        """The present time, in seconds."""
        ...

    def idle(self, deadline: float) -> None:
        """Nothing is ready before ``deadline``: a simulated clock jumps there, a real one does nothing."""
        ...

    def round(self) -> float:
        """A round of the scheduler begins: the present time."""
        ...


class RealClock:
    """The machine's monotonic clock; zero is when it was made."""

    def __init__(self) -> None:
        self._origin = time.monotonic()

    def now(self) -> float:
        """Seconds since this clock was made."""
        return time.monotonic() - self._origin

    def idle(self, deadline: float) -> None:
        """Real time passes by itself."""

    def round(self) -> float:
        """Seconds since this clock was made."""
        return time.monotonic() - self._origin


class SimClock:
    """A clock that stands still while jobs run and jumps to the next deadline when all of them sleep.

    Jobs that never sleep would keep it at one moment for ever: after ``PATIENCE`` rounds at the same time it creeps
    on, a millisecond every hundred rounds, so that a busy loop can be stopped by somebody who sleeps.
    """

    PATIENCE = 5000
    CREEP = 1e-5

    def __init__(self, start: float = 0.0) -> None:
        self._now = start
        self._rounds = 0

    def now(self) -> float:
        """The simulated time, in seconds."""
        return self._now

    def idle(self, deadline: float) -> None:
        """Jump to the deadline, never back."""
        self._now = max(self._now, deadline)
        self._rounds = 0

    def round(self) -> float:
        """The simulated time, in seconds."""
        self._rounds += 1
        if self._rounds > self.PATIENCE:
            self._now += self.CREEP
        return self._now

    def advance(self, seconds: float) -> None:
        """Let time pass by hand (tests of components that are told the time)."""
        self._now += seconds
