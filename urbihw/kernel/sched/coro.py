"""How a job is suspended: greenlets.  The only file that knows the mechanism.

Beginning a greenlet costs ten times what a switch does (CPython maps a fresh stack chunk for it), and most jobs are
short.  So jobs are run by *carriers*, greenlets that take one job after the other and rest in a pool in between.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING, Generic, TypeVar

from greenlet import GreenletExit, error, getcurrent, greenlet

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job

T = TypeVar("T")

CarrierEnded = GreenletExit
"""Raised in a job whose carrier is taken away, since nobody will run the scheduler any more."""

POOL = 64
"""How many carriers rest at most; more are let go."""


class Carrier:
    """A greenlet that runs jobs, one at a time; ``coro.switch()`` runs the job until it gives the processor away."""

    __slots__ = ("_pool", "coro", "job")

    def __init__(self, pool: Pool) -> None:
        self._pool = pool
        self.job: Job | None = None
        self.coro = greenlet(self._run, pool.hub)

    def frame(self) -> FrameType | None:
        """Where the job stands, while it is suspended."""
        return self.coro.gr_frame

    def end(self) -> None:
        """Take the greenlet away, in the thread that made it; its job leaves by GreenletExit."""
        with contextlib.suppress(error, ValueError):  # another thread
            self.coro.parent = getcurrent()  # to come back here, which may be a job of another kernel
            self.coro.throw(GreenletExit)

    def _run(self) -> None:
        while True:
            job = self.job
            assert job is not None
            job.main()
            job.carrier = self.job = None
            if isinstance(job.error, GreenletExit):  # the interpreter takes the greenlet away
                return
            scheduler = job.scheduler
            del job
            if not self._pool.rest(self):
                return
            scheduler.hand_over()


class Steps(Generic[T]):
    """A computation on a stack of its own, done step by step: ``work(pause)`` goes on until it calls ``pause()``.

    Whoever does the steps may give the processor away between them, however deep the work is in calls.  Python's limit
    of recursion belongs to the process: work that needs another one sets it, and has it during its steps only.
    """

    def __init__(self, work: Callable[[Callable[[], None]], T]) -> None:
        self._work = work
        self._coro = greenlet(self._run)
        self._limit = sys.getrecursionlimit()
        self._results: list[T] = []

    def step(self) -> bool:
        """Do a step; whether more are to come.  Raises what the work raises."""
        self._switch(self._coro.switch)
        return not self._coro.dead

    @property
    def result(self) -> T:
        """What the work gave, when it is done."""
        return self._results[0]

    def end(self) -> None:
        """Give the work up, if it is not done."""
        if not self._coro.dead:
            self._switch(partial(self._coro.throw, GreenletExit))

    def _run(self) -> None:
        self._results.append(self._work(self._pause))

    def _pause(self) -> None:
        assert self._coro.parent is not None
        self._coro.parent.switch()

    def _switch(self, switch: Callable[[], object]) -> None:
        usual = sys.getrecursionlimit()
        self._coro.parent = getcurrent()
        sys.setrecursionlimit(self._limit)
        try:
            switch()
        finally:
            self._limit = sys.getrecursionlimit()
            sys.setrecursionlimit(usual)


class Pool:
    """The carriers of one scheduler, and the hub: ``hub.switch()`` in a job gives the processor back to it."""

    def __init__(self) -> None:
        self.hub = getcurrent()
        self._resting: list[Carrier] = []

    def enter_hub(self) -> None:
        """The greenlet that calls is the hub from now on."""
        self.hub = getcurrent()

    def take(self, job: Job) -> Carrier:
        """A carrier for a job that begins."""
        carrier = self._resting.pop() if self._resting else Carrier(self)
        carrier.job = job
        return carrier

    def end(self) -> None:
        """Let go of the carriers that rest."""
        while self._resting:
            self._resting.pop().end()

    def rest(self, carrier: Carrier) -> bool:
        """A carrier's job is over; whether it may rest here."""
        if len(self._resting) >= POOL:
            return False
        self._resting.append(carrier)
        return True
