"""The one place where the scheduler meets asyncio.

``drive()`` runs the scheduler until no job is ready, and arms a timer for the next wake-up.  Each source of events (a
socket, a timer, a post from another thread) calls it directly, so an answer leaves in the iteration of the loop in
which the question came in.  A run that leaves ready jobs behind, or that took long, is followed by another one only
when all sockets have been read: the scheduler chooses among all clients that want something, not among those who were
heard first.  Else each of many clients that asyncio has heard at once could hold the interpreter before the others are
read.

A watchdog thread monitors the scheduler while it is busy (``watchdog``).
"""

from __future__ import annotations

import asyncio

from urbihw.kernel.sched.clock import LedClock, SimClock
from urbihw.kernel.sched.collector import COLLECTOR
from urbihw.kernel.sched.scheduler import MAX_RUN_S, Scheduler
from urbihw.kernel.server.bounds import NONE, Bounds
from urbihw.kernel.server.watchdog import Watchdog


class LoopDriver:
    """Runs one scheduler inside one asyncio loop."""

    def __init__(self, scheduler: Scheduler, bounds: Bounds = NONE) -> None:
        """Create it in the loop.  The ``bounds`` are enforced only if the loop runs in the main thread."""
        self.scheduler = scheduler
        scheduler.shares.max_of_one = bounds.max_jobs
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.Handle | None = None
        self._driving = False
        self._reading = False
        """Whether jobs, if any, are to run only when the sockets have been read."""
        self._closed = False
        self._called = False
        """Whether another thread has requested a drive that has not begun.  A second request would only cost time
        before the sockets have their turn."""
        self._watchdog = Watchdog(scheduler, bounds)
        self._memory = self._watchdog.memory
        scheduler.set_wake_host(self._wake)
        COLLECTOR.guard()

    def set_hold_limit(self, seconds: float) -> None:
        """Bound the processor time for which a job may hold the interpreter from now on; 0: no limit."""
        self._watchdog.hold_limit = seconds

    def _wake(self) -> None:
        if not self._closed and not self._called:
            self._called = True
            self._loop.call_soon_threadsafe(self._drive_as_called)

    def _drive_as_called(self) -> None:
        self._called = False  # cleared before the drive: a post from now on may come too late for it
        self.drive()

    def drive(self) -> None:
        """Run all ready jobs, and arm the timer for the next wake-up."""
        if self._driving or self._closed or self._reading:
            return
        self._driving = True
        clock = self.scheduler.clock
        began = clock.now()
        self._watchdog.begin()
        try:
            if self._memory is not None and self._memory.near:
                self._memory.begin()
                deadline = self.scheduler.run_turn()
                self._memory.charge_turn(self.scheduler.latest)
            else:
                deadline = self.scheduler.run()
        finally:
            self._watchdog.end()
            self._driving = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._closed:
            return
        if clock.now() - began > MAX_RUN_S:
            self._drive_after_reading()
            return
        if deadline is None:
            return
        if isinstance(clock, SimClock):
            clock.idle(deadline)
        delay = deadline - clock.now()
        if isinstance(clock, LedClock) and clock.is_led and delay > 0:
            return  # the leader of the clock posts the next step
        if delay <= 0:
            self._drive_after_reading()
        else:
            self._timer = self._loop.call_later(delay, self.drive)

    def _drive_after_reading(self) -> None:
        """Let asyncio hand out what it has heard, look at all sockets, and hand out that; then drive."""
        self._reading = True
        self._timer = self._loop.call_soon(self._read_sockets)

    def _read_sockets(self) -> None:
        """Drive after the sockets: asyncio has looked at them, and what it found stands behind this call."""
        self._timer = self._loop.call_soon(self._drive_on)

    def _drive_on(self) -> None:
        self._reading = False
        self.drive()

    def close(self) -> None:
        """Stop driving the scheduler.  A second call does nothing."""
        if not self._closed:
            COLLECTOR.release()
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()
        self._watchdog.close()
