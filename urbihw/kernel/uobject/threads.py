"""Bound functions that run in threads: the calling job waits, other jobs continue.

A lock mode defines which functions must not run at the same time (manual, section 3.3.3); a kernel-wide limit bounds
the number of threads.  Waiting jobs are served in the order of their calls.  All bookkeeping is done in the kernel's
thread and needs no locks.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Hashable
from enum import Enum
from typing import TYPE_CHECKING, Any

from urbihw.kernel.sched.waiting import Completion

if TYPE_CHECKING:
    from urbihw.kernel.sched.scheduler import Scheduler


class Lock(Enum):
    """The functions that must not run at the same time as a threaded function: none, the function itself, or others of
    its object, class or module.
    """

    NONE = "none"
    FUNCTION = "function"
    INSTANCE = "instance"
    CLASS = "class"
    MODULE = "module"


LOCK_NONE, LOCK_FUNCTION, LOCK_INSTANCE, LOCK_CLASS, LOCK_MODULE = Lock

DEFAULT_THREAD_LIMIT = 64
"""Default maximum number of threads; ``set_thread_limit`` changes it."""


class _Call:
    def __init__(self, work: Callable[[], Any], key: Hashable, answer: Completion[Any]) -> None:
        self.work = work
        self.key = key
        self.answer = answer


class Threads:
    """The threads of one kernel."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._waiting: deque[_Call] = deque()
        self._held: set[Hashable] = set()
        self._running = 0
        self.limit = DEFAULT_THREAD_LIMIT

    def run(self, work: Callable[[], Any], key: Hashable = None) -> Any:
        """Run ``work`` in a thread while the running job waits; returns its value or raises its exception.

        Calls with the same ``key`` run one after the other; None stands for no key.  If the job is stopped, its
        ``work`` continues and the value is discarded.
        """
        call = _Call(work, key, Completion(self._scheduler))
        self._waiting.append(call)
        self._start()
        try:
            return call.answer.wait()
        finally:
            if call in self._waiting:
                self._waiting.remove(call)

    def _start(self) -> None:
        """Start the waiting calls that may run now."""
        for call in list(self._waiting):
            if self._running >= self.limit:
                return
            if call.key is not None and call.key in self._held:
                continue
            self._waiting.remove(call)
            self._running += 1
            if call.key is not None:
                self._held.add(call.key)
            threading.Thread(target=self._work, args=(call,), name="urbihw-uobject", daemon=True).start()

    def _work(self, call: _Call) -> None:
        finish = call.answer.outcome_of(call.work)
        self._scheduler.post(lambda: self._over(call, finish))

    def _over(self, call: _Call, finish: Callable[[], None]) -> None:
        self._running -= 1
        self._held.discard(call.key)
        self._start()
        finish()
