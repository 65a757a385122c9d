"""``redefinitionMode``: ``var`` may overwrite slots as long as the function that asked for it runs.

The mode is tested only when a program declares a slot that exists, so that it costs nothing otherwise.
"""

from __future__ import annotations

import sys
from types import FrameType
from weakref import WeakKeyDictionary

from urbihw.kernel.runtime.backtrace import calling_frame
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.scheduler import Scheduler


class RedefinitionMode:
    """The functions and jobs that are in the mode."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._frames: WeakKeyDictionary[Job, FrameType] = WeakKeyDictionary()

    def begin(self) -> None:
        """Let the innermost urbiscript function of the running job redefine slots until it returns."""
        frame = calling_frame()
        if frame is not None:
            self._frames[self._scheduler.running()] = frame

    def is_on(self) -> bool:
        """Whether the running job may redefine a slot now."""
        job = self._scheduler.current
        if job is None or job not in self._frames:
            return False
        frame: FrameType | None = sys._getframe(1)
        while frame is not None and frame is not self._frames[job]:
            frame = frame.f_back
        if frame is None:
            del self._frames[job]
        return frame is not None
