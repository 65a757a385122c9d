"""Who makes the process grow, and what is done about it.

The operating system says how much memory the process has, not who took it.  So whoever runs while it grows is charged
with it.  As long as there is plenty that is looked at only now and then, and forgotten within seconds; near the limit
each turn of a job is looked at by itself.  What the process grows by between two turns (threads that read a file, the
sockets) is nobody's, and a connection that does not grow the process is not blamed.  Beyond the limit

1. the job that grows the process, of the connection that grew it most, gets ``memory exhausted``;
2. if that has not helped a second later, or it grows on, all that this connection runs is ended;
3. if that has not helped either, it is left at that: something that all share holds the memory.  The process may take
   ``MARGIN`` more before somebody is blamed anew.

What this cannot do: it does not know who holds memory that was taken long before it was near the limit, nor for whom
a job works (one that fills a list when it is asked to is charged, not who asks); it does not make a program let go of
what it keeps in a slot; and one built-in function that takes all there is at once is not stopped in it: such functions
bound what they make.
"""

from __future__ import annotations

import ctypes
import logging
import os
import weakref
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.collector import COLLECTOR
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.scheduler import Scheduler

log = logging.getLogger("urbihw.kernel")

MIB: Final = 1024 * 1024
NEAR: Final = 0.75
"""The share of the limit from which each turn is looked at."""
HELPS: Final = 1.0
"""Seconds that what was done about it has to help."""
FORGETS: Final = 1.0
"""Seconds after which what was seen while there was plenty counts half."""
EVIDENCE: Final = 8 * MIB
"""Bytes by which somebody must have made the process grow to be blamed."""
MARGIN: Final = 32 * MIB
"""Bytes that the process may grow while something is done about it, and beyond what it cannot be made to give back."""
TOLD: Final = "!!! memory exhausted: all that this connection was running is ended"

_PAGE: Final = os.sysconf("SC_PAGE_SIZE")


class Resident:
    """How much memory the process has, in bytes; 0 where the system does not say (``man 5 proc``, statm)."""

    def __init__(self) -> None:
        self._file = -1
        with suppress(OSError):
            self._file = os.open("/proc/self/statm", os.O_RDONLY | os.O_CLOEXEC)

    def __call__(self) -> int:
        return int(os.pread(self._file, 128, 0).split()[1]) * _PAGE if self._file >= 0 else 0

    def close(self) -> None:
        """Look no more."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


def trim() -> None:
    """Give what was freed back to the system, as far as the C library can."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


class Memory:
    """The account.  ``seen`` is for the thread of the watchdog, all else for that of the scheduler."""

    def __init__(
        self, scheduler: Scheduler, limit: int, resident: Callable[[], int], now: Callable[[], float]
    ) -> None:
        """``limit`` is in bytes; ``resident`` tells how much the process has, ``now`` the time, in seconds."""
        self._scheduler = scheduler
        self._limit = self._most = limit
        self._resident = resident
        self._now = now
        self._size = resident()
        self._halved = 0.0
        self._charged: dict[Any, int] = {}
        self._growing: dict[Any, weakref.ref[Job]] = {}
        """Who made the process grow last, of each connection; the error that ends a job holds what it had."""
        self._blamed: Any = None
        self._size_then = 0
        self._since = 0.0
        self._ended = False
        self.near = False
        """Whether each turn is to be looked at."""

    def seen(self) -> bool:
        """Look from another thread, now and then: whether there is so much that ``exceeded`` is to be called."""
        size = self._resident()
        if not self.near:
            self._sample(size)
            if size > NEAR * self._limit:
                self.near = True
        return size > self._most and not self._may_help(size)

    def _sample(self, size: int) -> None:
        """While there is plenty: charge whoever is found running since the last look."""
        grown, self._size = size - self._size, size
        now = self._now()
        if now - self._halved > FORGETS:
            self._halved = now
            for payer, charge in list(self._charged.items()):
                if charge < MIB:
                    del self._charged[payer], self._growing[payer]
                else:
                    self._charged[payer] = charge // 2
        job = self._scheduler.current
        if job is not None and grown > 0:
            self._charged[job.payer] = self._charged.get(job.payer, 0) + grown
            self._growing[job.payer] = weakref.ref(job)

    def begin(self) -> None:
        """A turn of a job begins."""
        self._size = self._resident()

    def turn(self, job: Job | None) -> None:
        """A turn of a job is over: charge it."""
        size = self._charge(job)
        if size > self._most:
            greedy = self._act(size, None)
            if greedy is not None:
                self._scheduler.throw(greedy, MemoryError())
        elif size < self._limit:
            self._most = self._limit
            if size < NEAR * self._limit - MARGIN:
                self._forget()
                self.near = False

    def exceeded(self, job: Job) -> bool:
        """In the middle of a turn there is too much: charge who runs; whether it is the one that must leave."""
        size = self._charge(job)
        return size > self._most and self._act(size, job) is job

    def ends(self) -> bool:
        """Whether the job that must leave is to be ended, whatever it catches."""
        return self._ended

    def _charge(self, job: Job | None) -> int:
        size = self._resident()
        grown, self._size = size - self._size, size
        if job is not None and grown:
            self._charged[job.payer] = max(0, self._charged.get(job.payer, 0) + grown)
            if grown > 0:
                self._growing[job.payer] = weakref.ref(job)
        return size

    def _may_help(self, size: int) -> bool:
        """Whether something was done about it that may still help."""
        return self._since > 0 and self._now() - self._since < HELPS and size < self._size_then + MARGIN

    def _act(self, size: int, running: Job | None) -> Job | None:
        """Do something about it; the job that must leave, if one must."""
        if self._may_help(size):
            return None
        if self._ended:
            self._give_up(size)
            return None
        if self._blamed is None:
            culprit = max(self._charged, key=lambda payer: self._charged[payer], default=None)
            if culprit is None or self._charged[culprit] < EVIDENCE:
                return None
            job = self._growing[culprit]()
            if running is not None and job is not running:
                return None  # a neighbour's turn: it is not to be left for that
            self._blamed = culprit
            self._done(size)
            if job is not None and not job.done:
                log.warning("memory exhausted: %d MiB are taken; job %s, which takes more, gets an error",
                            size // MIB, job.name)
                return job
        return self._end(size, running)

    def _done(self, size: int) -> None:
        self._size_then, self._since = size, self._now()

    def _end(self, size: int, running: Job | None) -> Job | None:
        """End all that the culprit runs; the running job, if it is one of his."""
        COLLECTOR.collect()
        trim()
        if self._resident() <= self._most:
            self._forget()
            return None
        lobby, self._ended = self._blamed, True
        self._done(size)
        if isinstance(lobby, Lobby):
            log.warning("memory exhausted: %d MiB are taken; all that connection %s runs is ended",
                        size // MIB, lobby.tag.tag.name)
            self._scheduler.post(lambda: end_all(lobby))
        return running if running is not None and running.payer is lobby else None

    def _give_up(self, size: int) -> None:
        log.warning("memory exhausted: %d MiB stay taken: slots hold them; empty them, or end the connection",
                    size // MIB)
        self._most = size + MARGIN
        self._forget()

    def _forget(self) -> None:
        self._charged.clear()
        self._growing.clear()
        self._blamed, self._ended, self._since = None, False, 0.0


def end_all(lobby: Lobby, told: str = TOLD) -> None:
    """End all that a connection runs, and tell it why; it stays open."""
    lobby.output.line(told, "error")
    lobby.tag.tag.stop(lobby.world.void)
