"""Clocks.  The scheduler gets one as an argument; no other module reads the time."""

from __future__ import annotations

import time
from typing import Final, Protocol

STANDSTILL: Final = 0.0
"""The processor time by a clock that is not real."""


class Clock(Protocol):
    """Seconds since the kernel started, never going back."""

    def now(self) -> float:
        """The present time, in seconds."""
        ...

    def idle(self, deadline: float) -> None:
        """No job is ready before ``deadline``: a simulated clock jumps there, a real clock does nothing."""
        ...

    def round(self) -> float:
        """A round of the scheduler begins: the present time."""
        ...

    def processor_time(self) -> float:
        """Seconds of processor time that the calling thread has used; stands still while time is not real."""
        ...


class RealClock:
    """The machine's monotonic clock; zero is the time when the object was made."""

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

    def processor_time(self) -> float:
        """Seconds of processor time that the calling thread has used."""
        return time.thread_time()


class LedClock:
    """A clock that the robot leads: a simulator, whose time is that of the programs.

    Until the robot leads it for the first time it stands at 0, so that a start takes no time; after ``release``, while
    there is no simulator, it runs like the clock of the machine.  It never goes back.
    """

    ROUNDING_S = 1e-9
    """The clock is ahead of the simulation by this: what is due at the time of a step must be due although sums of
    fractions are not exact."""

    def __init__(self) -> None:
        self._now = 0.0
        self._led = True
        self._since = 0.0

    @property
    def is_led(self) -> bool:
        """Whether time passes by ``lead`` only."""
        return self._led

    def now(self) -> float:
        """The time, in seconds."""
        return self._now if self._led else self._now + time.monotonic() - self._since

    def lead(self, seconds: float) -> None:
        """It is this time, until the next call."""
        self._now, self._led = max(self.now(), seconds + self.ROUNDING_S), True

    def release(self) -> None:
        """Go on in real time: the clock is no longer led."""
        if self._led:
            self._led, self._since = False, time.monotonic()

    def idle(self, deadline: float) -> None:
        """Time passes by ``lead``."""

    def round(self) -> float:
        """The time, in seconds."""
        return self.now()

    def processor_time(self) -> float:
        """Stands still while the clock is led."""
        return STANDSTILL if self._led else time.thread_time()


class SimClock:
    """A simulated clock: it stands still while jobs run, and jumps to the next deadline when all jobs sleep.

    Jobs that never sleep would hold the clock at one time for ever.  So after ``ROUNDS_AT_ONE_TIME`` rounds at the same
    time the clock advances by ``CREEP_S`` seconds a round.  A sleeping job can then wake up and stop a busy loop.
    """

    ROUNDS_AT_ONE_TIME = 5000
    CREEP_S = 1e-5

    def __init__(self, start: float = 0.0) -> None:
        self._now = start
        self._rounds = 0

    def now(self) -> float:
        """The simulated time, in seconds."""
        return self._now

    def idle(self, deadline: float) -> None:
        """Jump to the deadline; never goes back."""
        self._now = max(self._now, deadline)
        self._rounds = 0

    def round(self) -> float:
        """The simulated time, in seconds."""
        self._rounds += 1
        if self._rounds > self.ROUNDS_AT_ONE_TIME:
            self._now += self.CREEP_S
        return self._now

    def processor_time(self) -> float:
        """Stands still, so programs run in the same order on each machine."""
        return STANDSTILL

    def advance(self, seconds: float) -> None:
        """Advance the time by hand, for tests of components that take the time as an argument."""
        self._now += seconds
