"""Memory accounting: finds the connection whose jobs make the process grow, and enforces the memory limit.

The operating system reports the memory of the process, not of a connection.  So the connection whose job runs while the
process grows is charged for the growth.  Far below the limit the size is sampled now and then, and charges decay within
seconds; near the limit each turn of a job is measured.  Growth between two turns (threads that read a file, the
sockets) is not charged, and a connection whose jobs do not make the process grow is not blamed. Beyond the limit

1. the growing job of the connection with the highest charge gets the error ``memory exhausted``;
2. if the memory is not released within a second, or the process grows further, all jobs of this connection are ended;
3. if that does not help either, no more is done: objects that all connections share hold the memory.  The process may
   grow by another ``GROWTH_MARGIN`` before a connection is blamed again.

Limitations: the account does not know which connection holds memory that was allocated long before the limit was near,
nor on whose behalf a job works (a job that fills a list on request is charged, not the requester).  It cannot make a
program release objects in its slots.  It does not interrupt a single built-in function that allocates all memory at
once: such functions limit their results themselves.
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
NEAR_LIMIT: Final = 0.75
"""Share of the limit above which each turn is measured."""
EFFECT_TIMEOUT_S: Final = 1.0
"""Seconds for an error or an end of jobs to take effect."""
CHARGE_HALF_LIFE_S: Final = 1.0
"""Seconds after which a charge from far below the limit counts half."""
MIN_CHARGE: Final = 8 * MIB
"""Bytes that a connection must have been charged with to be blamed."""
GROWTH_MARGIN: Final = 32 * MIB
"""Bytes that the process may grow while an action takes effect, and beyond memory that cannot be released."""
MEMORY_MESSAGE: Final = "!!! memory exhausted: all that this connection was running is ended"

_PAGE: Final = os.sysconf("SC_PAGE_SIZE")


class ResidentMemory:
    """Reads the resident memory of the process, in bytes; 0 on a system without it (``man 5 proc``, statm)."""

    def __init__(self) -> None:
        self._file = -1
        with suppress(OSError):
            self._file = os.open("/proc/self/statm", os.O_RDONLY | os.O_CLOEXEC)

    def __call__(self) -> int:
        return int(os.pread(self._file, 128, 0).split()[1]) * _PAGE if self._file >= 0 else 0

    def close(self) -> None:
        """Close the file of the kernel's statistics."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


def trim() -> None:
    """Return freed memory to the system, as far as the C library can."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


class MemoryAccount:
    """The charges of all connections.  ``is_over_limit`` is for the watchdog's thread, all else for the scheduler's."""

    def __init__(
        self, scheduler: Scheduler, limit: int, resident: Callable[[], int], now: Callable[[], float]
    ) -> None:
        """``limit`` is in bytes.  ``resident`` returns the memory of the process in bytes, ``now`` the time in
        seconds."""
        self._scheduler = scheduler
        self._limit = self._most = limit
        self._resident = resident
        self._now = now
        self._size = resident()
        self._halved = 0.0
        self._charged: dict[Any, int] = {}
        self._growing: dict[Any, weakref.ref[Job]] = {}
        """The last job of each connection that made the process grow; weak, because an error holds the objects of its
        job."""
        self._blamed: Any = None
        self._size_then = 0
        self._since = 0.0
        self._ended = False
        self.near = False
        """Whether each turn is measured."""

    def is_over_limit(self) -> bool:
        """Sample the memory from another thread: whether ``must_end`` must be called."""
        size = self._resident()
        if not self.near:
            self._sample(size)
            if size > NEAR_LIMIT * self._limit:
                self.near = True
        return size > self._most and not self._is_action_pending(size)

    def _sample(self, size: int) -> None:
        """Far below the limit: charge the job that is running with the growth since the last sample."""
        grown, self._size = size - self._size, size
        now = self._now()
        if now - self._halved > CHARGE_HALF_LIFE_S:
            self._halved = now
            for charged_context, charge in list(self._charged.items()):
                if charge < MIB:
                    del self._charged[charged_context], self._growing[charged_context]
                else:
                    self._charged[charged_context] = charge // 2
        job = self._scheduler.current
        if job is not None and grown > 0:
            self._charged[job.charged_context] = self._charged.get(job.charged_context, 0) + grown
            self._growing[job.charged_context] = weakref.ref(job)

    def begin(self) -> None:
        """A turn of a job begins: measure the memory."""
        self._size = self._resident()

    def charge_turn(self, job: Job | None) -> None:
        """A turn of a job is over: charge it."""
        size = self._charge(job)
        if size > self._most:
            greedy = self._respond(size, None)
            if greedy is not None:
                self._scheduler.throw(greedy, MemoryError())
        elif size < self._limit:
            self._most = self._limit
            if size < NEAR_LIMIT * self._limit - GROWTH_MARGIN:
                self._clear_charges()
                self.near = False

    def must_end(self, job: Job) -> bool:
        """The limit is exceeded within a turn: charge the running job.  Returns whether this job must be ended."""
        size = self._charge(job)
        return size > self._most and self._respond(size, job) is job

    def is_final(self) -> bool:
        """Whether the job must be ended for good, not by an error that it can catch."""
        return self._ended

    def _charge(self, job: Job | None) -> int:
        size = self._resident()
        grown, self._size = size - self._size, size
        if job is not None and grown:
            self._charged[job.charged_context] = max(0, self._charged.get(job.charged_context, 0) + grown)
            if grown > 0:
                self._growing[job.charged_context] = weakref.ref(job)
        return size

    def _is_action_pending(self, size: int) -> bool:
        """Whether an error or an end of jobs may still take effect."""
        is_recent = self._since > 0 and self._now() - self._since < EFFECT_TIMEOUT_S
        return is_recent and size < self._size_then + GROWTH_MARGIN

    def _respond(self, size: int, running: Job | None) -> Job | None:
        """Respond to exceeded memory.  Returns the job that must be ended, None if there is none."""
        if self._is_action_pending(size):
            return None
        if self._ended:
            self._give_up(size)
            return None
        if self._blamed is None:
            culprit = max(self._charged, key=lambda charged_context: self._charged[charged_context], default=None)
            if culprit is None or self._charged[culprit] < MIN_CHARGE:
                return None
            job = self._growing[culprit]()
            if running is not None and job is not running:
                return None  # a turn of another job, which must not be interrupted
            self._blamed = culprit
            self._record_action(size)
            if job is not None and not job.done:
                log.warning("memory exhausted: %d MiB are taken; job %s, which takes more, gets an error",
                            size // MIB, job.name)
                return job
        return self._end(size, running)

    def _record_action(self, size: int) -> None:
        self._size_then, self._since = size, self._now()

    def _end(self, size: int, running: Job | None) -> Job | None:
        """End all jobs of the blamed connection.  Returns the running job if it is one of them."""
        COLLECTOR.collect()
        trim()
        if self._resident() <= self._most:
            self._clear_charges()
            return None
        lobby, self._ended = self._blamed, True
        self._record_action(size)
        if isinstance(lobby, Lobby):
            log.warning("memory exhausted: %d MiB are taken; all that connection %s runs is ended",
                        size // MIB, lobby.tag.tag.name)
            self._scheduler.post(lambda: end_all(lobby))
        return running if running is not None and running.charged_context is lobby else None

    def _give_up(self, size: int) -> None:
        log.warning("memory exhausted: %d MiB stay taken: slots hold them; empty them, or end the connection",
                    size // MIB)
        self._most = size + GROWTH_MARGIN
        self._clear_charges()

    def _clear_charges(self) -> None:
        self._charged.clear()
        self._growing.clear()
        self._blamed, self._ended, self._since = None, False, 0.0


def end_all(lobby: Lobby, told: str = MEMORY_MESSAGE) -> None:
    """End all jobs of a connection and report the reason to it.  The connection stays open."""
    lobby.output.line(told, "error")
    lobby.tag.tag.stop(lobby.world.void)
