"""Evaluates conditions and emits events on behalf of devices and timers, which do not run in a job."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

from urbihw.kernel.sched.job import SLEEPING, WAITING, Job

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.kernel")


class Notifier:
    """The actions that wait for a job to run them, and that job."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._scheduler = world.scheduler
        self._actions: deque[Callable[[], None]] = deque()
        self._job: Job | None = None

    def call_soon(self, action: Callable[[], None]) -> None:
        """Run an action that may change conditions or emit events: at once inside a job, else in a job of its own.

        Actions from outside any job are collected, so that a burst of samples costs one job.
        """
        if self._scheduler.current is not None:
            action()
            return
        self._actions.append(action)
        job = self._job
        # A job that is delayed by a condition or a guard of a program is not waited for.
        if job is None or job.done or job.state in (SLEEPING, WAITING):
            self._job = self._world.spawn_own(self._run_actions, "notify")

    def _run_actions(self) -> None:
        try:
            while self._actions:
                action = self._actions.popleft()
                try:
                    action()
                except Exception as error:
                    log.error("error in a notification: %s", "; ".join(self._world.describe(error)))
        finally:
            # A signal has ended this job, because a condition of a program held the interpreter: the others go on.
            if self._actions and not self._scheduler.abandoned:
                self._job = self._world.spawn_own(self._run_actions, "notify")
