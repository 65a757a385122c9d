"""Bound functions that run in threads: the urbiscript job waits, the others go on.

A lock mode says what must not run at the same time (manual, section 3.3.3); a kernel-wide limit says how many threads
there may be at all.  Who has to wait is served in the order of asking.  All bookkeeping is done in the kernel's thread,
so there is nothing to lock.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Hashable
from enum import Enum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from urbihw.kernel.sched.scheduler import Scheduler


class Lock(Enum):
    """What a threaded function must not run beside: nothing, itself, or others of its object, class or module."""

    NONE = "none"
    FUNCTION = "function"
    INSTANCE = "instance"
    CLASS = "class"
    MODULE = "module"


LOCK_NONE, LOCK_FUNCTION, LOCK_INSTANCE, LOCK_CLASS, LOCK_MODULE = Lock

DEFAULT_LIMIT = 64
"""Threads at a time, unless ``set_thread_limit`` says otherwise."""


class _Call:
    def __init__(self, work: Callable[[], Any], key: Hashable, done: Callable[[], None]) -> None:
        self.work = work
        self.key = key
        self.done = done
        self.answers: list[tuple[Any, Exception | None]] = []


class Threads:
    """The threads of one kernel."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._waiting: deque[_Call] = deque()
        self._held: set[Hashable] = set()
        self._running = 0
        self.limit = DEFAULT_LIMIT

    def run(self, work: Callable[[], Any], key: Hashable = None) -> Any:
        """Run ``work`` in a thread while the running job waits; its value, or the exception it raised.

        Works of the same ``key`` run one after the other; None is no key.  A job that is stopped leaves its work
        running, whose value is then lost.
        """
        scheduler = self._scheduler
        job = scheduler.running()
        waits = [True]

        def done() -> None:
            if waits:
                scheduler.wake(job)

        call = _Call(work, key, done)
        self._waiting.append(call)
        self._start()
        try:
            while not call.answers:
                scheduler.suspend(None)
        finally:
            waits.clear()
            if call in self._waiting:
                self._waiting.remove(call)
        value, error = call.answers[0]
        if error is not None:
            raise error
        return value

    def _start(self) -> None:
        """Start what may run."""
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
        try:
            answer: tuple[Any, Exception | None] = (call.work(), None)
        except Exception as error:
            answer = (None, error)
        self._scheduler.post(lambda: self._over(call, answer))

    def _over(self, call: _Call, answer: tuple[Any, Exception | None]) -> None:
        call.answers.append(answer)
        self._running -= 1
        self._held.discard(call.key)
        self._start()
        call.done()
