"""How a job waits for something: the only callers of ``Scheduler.suspend``.

=================  =====================================================================================
``Completion``     happens once, with a value or an error; one job waits for it
``WaitQueue``      happens again and again; the first waiting job is woken, or all of them
``HandoverQueue``  values are handed out, each to the job that has waited longest
``wait_for_ever``  nothing will come; the job ends when a tag or a client stops it
``wait_unfrozen``  the job waits until no tag freezes it any more
=================  =====================================================================================

A job that is stopped while it waits leaves the queue.  Waking it after that does nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.sched.scheduler import Scheduler

T = TypeVar("T")


class Completion(Generic[T]):
    """An event that happens once, for which one job waits.  It may happen before the job waits."""

    __slots__ = ("_error", "_scheduler", "_value", "done", "job")

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self.job: Job | None = None
        """The job that waits."""
        self.done = False
        self._value: Any = None
        self._error: Exception | None = None

    def complete(self, value: T) -> None:
        """Let the waiting job go on with this value.  Only the first ``complete`` or ``fail`` counts."""
        self._finish(value, None)

    def fail(self, error: Exception) -> None:
        """Raise an error in the waiting job.  Only the first ``complete`` or ``fail`` counts."""
        self._finish(None, error)

    def _finish(self, value: T | None, error: Exception | None) -> None:
        if self.done:
            return
        self.done, self._value, self._error = True, value, error
        if self.job is not None:
            self._scheduler.wake(self.job)

    def outcome_of(self, work: Callable[[], T]) -> Callable[[], None]:
        """Do the work, in any thread, and return a function that completes this with its value or fails with its error.

        The returned function must be called in the scheduler's thread: ``scheduler.post(answer.outcome_of(work))``.
        """
        try:
            value = work()
        except Exception as error:
            return partial(self.fail, error)
        return partial(self.complete, value)

    @property
    def value(self) -> T:
        """The value given to ``complete``."""
        found: T = self._value
        return found

    def wait(self) -> T:
        """Park the running job until ``complete`` or ``fail``; return the value or raise the error."""
        scheduler = self._scheduler
        self.job = scheduler.running()
        try:
            while not self.done:
                scheduler.suspend(None)
        finally:
            self.job = None
        if self._error is not None:
            raise self._error
        return self.value


class WaitQueue:
    """Waiting jobs, in the order in which they began to wait."""

    __slots__ = ("_jobs", "_scheduler")

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._jobs: deque[Job] = deque()

    def __len__(self) -> int:
        return len(self._jobs)

    def wait(self) -> None:
        """Park the running job here until it is woken."""
        job = self._scheduler.running()
        self._jobs.append(job)
        self._scheduler.suspend(lambda: self._jobs.remove(job))

    def wait_until(self, deadline: float) -> None:
        """Park the running job here until it is woken, or until a time of the scheduler's clock, in seconds."""
        job = self._scheduler.running()

        def give_up() -> None:
            if job in self._jobs:
                self._jobs.remove(job)
                self._scheduler.wake(job)

        timer = self._scheduler.call_at(deadline, give_up)
        try:
            self.wait()
        finally:
            timer.cancel()

    def wake_one(self) -> bool:
        """Let the first job go on; False if no job waits."""
        if not self._jobs:
            return False
        self._scheduler.wake(self._jobs.popleft())
        return True

    def wake_all(self) -> None:
        """Let all jobs go on, in order."""
        while self.wake_one():
            pass


class HandoverQueue(Generic[T]):
    """Waiting jobs, each of which gets a value."""

    __slots__ = ("_places", "_scheduler")

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._places: deque[Completion[T]] = deque()

    def __len__(self) -> int:
        return len(self._places)

    def wait(self, give_back: Callable[[T], object] | None = None) -> T:
        """Park the running job until it gets a value, and return the value.

        ``give_back(value)`` is called if the job is stopped after it was given the value and before it goes on.
        """
        place: Completion[T] = Completion(self._scheduler)
        self._places.append(place)
        try:
            return place.wait()
        except BaseException:
            if not place.done:
                self._places.remove(place)
            elif give_back is not None:
                give_back(place.value)
            raise

    def hand_over(self, value: T) -> Job | None:
        """Give a value to the job that has waited longest, and return that job; None if no job waits."""
        if not self._places:
            return None
        place = self._places.popleft()
        job = place.job
        place.complete(value)
        return job


def wait_for_ever(scheduler: Scheduler) -> None:
    """Park the running job until it is stopped."""
    while True:
        scheduler.suspend(None)


def wait_unfrozen(scheduler: Scheduler) -> None:
    """Park the running job until no tag of it is frozen: it has frozen itself, or entered code under a frozen tag."""
    job = scheduler.running()
    while job.frozen:
        job.held = True
        scheduler.suspend(None)
