"""The one place where the scheduler meets asyncio.

``drive()`` runs the scheduler until nothing is ready and arms a timer for the next wake-up.  It is called straight from
whoever brought news (a socket, a timer, a post from another thread), so an answer leaves in the same turn of the loop
as the question came in.

A watchdog thread looks every few milliseconds while the scheduler is busy.  It makes ``run`` come up for air, so that
an endless loop of ``;`` does not starve the sockets, and it logs a job that holds the interpreter for more than a
second.
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
"""Seconds of uninterrupted work after which the sockets get a turn."""
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
    """The thread that looks while the scheduler is busy."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._main = threading.get_ident()
        self._busy = threading.Event()
        self._runs = 0
        self._closed = False
        self._thread = threading.Thread(target=self._watch, name="urbihw-watchdog", daemon=True)
        self._thread.start()

    def begin(self) -> None:
        """The scheduler begins to run."""
        self._runs += 1
        self._busy.set()

    def end(self) -> None:
        """The scheduler is idle."""
        self._busy.clear()

    def close(self) -> None:
        """End the thread."""
        self._closed = True
        self._busy.set()

    def _watch(self) -> None:
        while not self._closed:
            self._busy.wait()
            run = self._runs
            time.sleep(AIR)
            if self._busy.is_set() and run == self._runs and not self._closed:
                self._scheduler.interrupt()
                self._follow(run)

    def _follow(self, run: int) -> None:
        """The interruption waits for the end of a turn: how long does that turn last?"""
        began, named = time.monotonic(), False
        while self._busy.is_set() and run == self._runs and not self._closed:
            time.sleep(AIR)
            if not named and time.monotonic() - began > HELD:
                named = True
                job = self._scheduler.current
                frame = sys._current_frames().get(self._main)
                where = "" if frame is None else self._scheduler.place(frame)
                log.warning("job %s holds the interpreter for more than a second%s", job.name if job else "?", where)
