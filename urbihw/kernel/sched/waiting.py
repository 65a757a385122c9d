"""Queues of waiting jobs.  Waiting returns when woken; a job stopped while it waits leaves the queue by its undo."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.sched.scheduler import Scheduler


class WaitQueue:
    """Jobs waiting for something, in the order in which they came."""

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

    def wake_one(self) -> bool:
        """Let the first one go on; whether there was one."""
        if not self._jobs:
            return False
        self._scheduler.wake(self._jobs.popleft())
        return True

    def wake_all(self) -> None:
        """Let all go on, in order."""
        while self.wake_one():
            pass
