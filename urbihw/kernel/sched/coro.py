"""Suspending jobs with greenlets.  No other module depends on the mechanism.

Starting a greenlet costs ten times as much as a switch (CPython maps a fresh stack chunk for it), and most jobs are
short.  So jobs are run by *carriers*: greenlets that run one job after the other and wait in a pool in between.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING, Generic, TypeVar

from greenlet import GreenletExit, error, getcurrent, greenlet

from urbihw.kernel.recursion import set_recursion_limit

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job

T = TypeVar("T")

CarrierEnded = GreenletExit
"""Raised in a job whose carrier is ended because the scheduler will not run any more."""

MAX_RESTING = 64
"""Maximum number of carriers in the pool; further ones end with their job."""


class Carrier:
    """A greenlet that runs jobs, one at a time; ``coro.switch()`` runs the job until it yields, waits or ends."""

    __slots__ = ("_pool", "coro", "job")

    def __init__(self, pool: Pool) -> None:
        self._pool = pool
        self.job: Job | None = None
        self.coro = greenlet(self._run, pool.hub)

    def frame(self) -> FrameType | None:
        """The Python frame of the suspended job."""
        return self.coro.gr_frame

    def end(self) -> None:
        """End the greenlet, in the thread that made it; GreenletExit is raised in its job."""
        with contextlib.suppress(error, ValueError):  # called in another thread
            self.coro.parent = getcurrent()  # return to the caller, which may be a job of another kernel
            self.coro.throw(GreenletExit)

    def _run(self) -> None:
        while True:
            job = self.job
            assert job is not None
            job.main()
            job.carrier = self.job = None
            if isinstance(job.error, GreenletExit):  # the greenlet was ended
                return
            scheduler = job.scheduler
            del job
            if not self._pool.accept_resting(self):
                return
            scheduler.hand_over()


class Steps(Generic[T]):
    """A computation on its own stack, done in steps: a step of ``work(pause)`` ends when it calls ``pause()``.

    The caller may yield to other jobs between the steps, however deep the work is in calls.  Python's recursion limit
    belongs to the process: work that needs another limit sets it, and the limit is in force during its steps only.
    """

    def __init__(self, work: Callable[[Callable[[], None]], T]) -> None:
        self._work = work
        self._coro = greenlet(self._run)
        self._limit = sys.getrecursionlimit()
        self._results: list[T] = []

    def step(self) -> bool:
        """Do a step, and return whether more steps follow.  Raises what the work raises."""
        self._switch(self._coro.switch)
        return not self._coro.dead

    @property
    def result(self) -> T:
        """The return value of the work, when it is done."""
        return self._results[0]

    def end(self) -> None:
        """Cancel the work if it is not done: GreenletExit is raised in it."""
        if not self._coro.dead:
            self._switch(partial(self._coro.throw, GreenletExit))

    def _run(self) -> None:
        self._results.append(self._work(self._pause))

    def _pause(self) -> None:
        assert self._coro.parent is not None
        self._coro.parent.switch()

    def _switch(self, switch: Callable[[], object]) -> None:
        usual = set_recursion_limit(self._limit)
        self._coro.parent = getcurrent()
        try:
            switch()
        finally:
            self._limit = sys.getrecursionlimit()
            sys.setrecursionlimit(usual)


class Pool:
    """The carriers of one scheduler, and the hub: the greenlet that runs ``Scheduler.run``, and to which jobs switch
    back.
    """

    def __init__(self) -> None:
        self.enter_hub()
        self.resting: list[Carrier] = []
        """Carriers without a job.  Each is suspended at the point where a switch makes it start its next job."""

    def enter_hub(self) -> None:
        """Make the calling greenlet the hub."""
        # Twice, since greenlet releases the last greenlet of a thread that ends if it has one reference left which
        # `gc.get_referrers` does not find: that of an object which is frozen (`gc.freeze`).  The process crashes then.
        self.hub = self._hub = getcurrent()

    def assign_carrier(self, job: Job) -> Carrier:
        """Give a job that starts a carrier, from the pool if there is one."""
        carrier = self.resting.pop() if self.resting else Carrier(self)
        carrier.job = job
        return carrier

    def end(self) -> None:
        """End the carriers in the pool."""
        while self.resting:
            self.resting.pop().end()

    def accept_resting(self, carrier: Carrier) -> bool:
        """Take a carrier without a job into the pool; False if the pool is full."""
        if len(self.resting) >= MAX_RESTING:
            return False
        self.resting.append(carrier)
        return True
