"""The one place where the scheduler meets asyncio.

``drive()`` runs the scheduler until nothing is ready and arms a timer for the next wake-up.  It is called straight from
whoever brought news (a socket, a timer, a post from another thread), so an answer leaves in the same turn of the loop
as the question came in.

A watchdog thread looks on while the scheduler is busy.  It makes ``run`` come up for air, so that an endless loop of
``;`` does not starve the sockets, and it logs a job that holds the interpreter for more than a second.  It is not woken
for each run, which would cost more than a short command does: it looks from time to time, and rests only when nothing
has run for a while.
"""

from __future__ import annotations

import asyncio
import logging
import sys
import threading
import time

from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.scheduler import Scheduler

log = logging.getLogger("urbihw.kernel")

AIR = 0.004
"""Seconds of uninterrupted work after which the sockets get a turn, once the watchdog looks closely."""
CALM = 0.02
"""Seconds between two looks of the watchdog while all runs are short."""
REST = 1.0
"""Seconds without a run after which the watchdog rests."""
HELD = 1.0
"""Seconds after which a job that does not yield is named in the log."""


class Driver:
    """Runs one scheduler inside one asyncio loop."""

    def __init__(self, scheduler: Scheduler) -> None:
        self.scheduler = scheduler
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.Handle | None = None
        self._driving = False
        self._closed = False
        self._watchdog = Watchdog(scheduler)
        scheduler.set_wake_host(self._wake)

    def _wake(self) -> None:
        if not self._closed:
            self._loop.call_soon_threadsafe(self.drive)

    def drive(self) -> None:
        """Run what is ready and see to it that we are called again in time."""
        if self._driving or self._closed:
            return
        self._driving = True
        self._watchdog.begin()
        try:
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
            self._timer = self._loop.call_soon(self.drive)
        else:
            self._timer = self._loop.call_later(delay, self.drive)

    def close(self) -> None:
        """Drive no more."""
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()
        self._watchdog.close()


class Watchdog:
    """The thread that looks on while the scheduler is busy."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._main = threading.get_ident()
        self._count = 0
        """Beginnings and ends of runs so far: odd while one lasts."""
        self._rests = False
        self._wake = threading.Event()
        self._closed = False
        self._thread = threading.Thread(target=self._watch, name="urbihw-watchdog", daemon=True)
        self._thread.start()

    def begin(self) -> None:
        """The scheduler begins to run."""
        self._count += 1
        if self._rests:
            self._wake.set()

    def end(self) -> None:
        """The scheduler is idle."""
        self._count += 1

    def close(self) -> None:
        """End the thread."""
        self._closed = True
        self._wake.set()

    def _watch(self) -> None:
        """Look, sleep, look.  What is found busy twice is interrupted, even if it is another run by then."""
        last = _Look(0, 0.0)
        while not self._closed:
            busy = self._count % 2 == 1
            look = last if last.count == self._count else _Look(self._count, time.monotonic())
            if busy and last.count % 2:
                self._interrupt(look)
            elif not busy and time.monotonic() - look.began > REST:
                self._rest(look)
            last = look
            time.sleep(AIR if busy else CALM)

    def _interrupt(self, look: _Look) -> None:
        """Interrupt a run; it goes on to the end of the present job's turn, and if that takes long, name the job."""
        if not look.interrupted:
            look.interrupted = True
            self._scheduler.interrupt()
        elif not look.named and time.monotonic() - look.began > HELD:
            look.named = True
            job = self._scheduler.current
            frame = sys._current_frames().get(self._main)
            where = "" if frame is None else self._scheduler.place(frame)
            log.warning("job %s holds the interpreter for more than a second%s", job.name if job else "?", where)

    def _rest(self, look: _Look) -> None:
        """Wait until something runs."""
        self._wake.clear()
        self._rests = True
        if self._count == look.count and not self._closed:
            self._wake.wait()
        self._rests = False


class _Look:
    """What the watchdog saw: the count, when it saw it first, and what it did about it."""

    __slots__ = ("began", "count", "interrupted", "named")

    def __init__(self, count: int, began: float) -> None:
        self.count = count
        self.began = began
        self.interrupted = False
        self.named = False
