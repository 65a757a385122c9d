"""The one place where the scheduler meets asyncio.

``drive()`` runs the scheduler until nothing is ready and arms a timer for the next wake-up.  It is called straight from
whoever brought news (a socket, a timer, a post from another thread), so an answer leaves in the same turn of the loop
as the question came in.

A watchdog thread looks on while the scheduler is busy (see ``watchdog``).
"""

from __future__ import annotations

import asyncio

from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.collector import COLLECTOR
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.server.bounds import NONE, Bounds
from urbihw.kernel.server.watchdog import Watchdog


class Driver:
    """Runs one scheduler inside one asyncio loop."""

    def __init__(self, scheduler: Scheduler, bounds: Bounds = NONE) -> None:
        """To be made in the loop, which runs in the main thread if ``bounds`` are to be kept."""
        self.scheduler = scheduler
        scheduler.most_jobs_of_one = bounds.max_jobs
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.Handle | None = None
        self._driving = False
        self._closed = False
        self._called = False
        """Whether another thread has called for a drive that has not begun: a second one would do nothing but take
        its time, before the sockets have their turn."""
        self._watchdog = Watchdog(scheduler, bounds)
        self._memory = self._watchdog.memory
        scheduler.set_wake_host(self._wake)
        COLLECTOR.guard()

    def _wake(self) -> None:
        if not self._closed and not self._called:
            self._called = True
            self._loop.call_soon_threadsafe(self._drive_as_called)

    def _drive_as_called(self) -> None:
        self._called = False  # before it: what is posted from now on may come too late for this drive
        self.drive()

    def drive(self) -> None:
        """Run what is ready and see to it that we are called again in time."""
        if self._driving or self._closed:
            return
        self._driving = True
        self._watchdog.begin()
        try:
            if self._memory is not None and self._memory.near:
                self._memory.begin()
                deadline = self.scheduler.run_turn()
                self._memory.turn(self.scheduler.latest)
            else:
                deadline = self.scheduler.run()
        finally:
            self._watchdog.end()
            self._driving = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if deadline is None or self._closed:
            return
        clock = self.scheduler.clock
        if isinstance(clock, SimClock):
            clock.idle(deadline)
        delay = deadline - clock.now()
        if delay <= 0:
            # Not call_soon: what has come by the sockets meanwhile goes first.
            self._timer = self._loop.call_soon(self.drive)
        else:
            self._timer = self._loop.call_later(delay, self.drive)

    def close(self) -> None:
        """Drive no more; twice is fine."""
        if not self._closed:
            COLLECTOR.release()
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()
        self._watchdog.close()
