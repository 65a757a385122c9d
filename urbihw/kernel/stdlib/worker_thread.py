"""A worker thread for long native work: the calling job waits, and the lobbies share the thread in turns.

So that no lobby can delay the others by many requests, each lobby has a queue of its own and the thread takes one
request of each in turn.  The thread starts with the first request and ends after some seconds without one.
"""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Final, Generic, TypeVar

from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.waiting import Completion

T = TypeVar("T")

IDLE_TIMEOUT_S: Final = 5.0
"""Idle time in seconds after which the thread ends."""


class _Request(Generic[T]):
    """A request: the work to be done, and the job that waits for it."""

    def __init__(self, scheduler: Scheduler, work: Callable[[], T]) -> None:
        self._scheduler = scheduler
        self._work = work
        self.answer: Completion[T] = Completion(scheduler)

    def execute(self) -> None:
        """Do the work, in the thread."""
        self._scheduler.post(self.answer.outcome_of(self._work))


class WorkerThread:
    """The worker thread and its queues."""

    def __init__(self, world: World, on_idle: Callable[[], None]) -> None:
        """``on_idle`` is called in the thread before it ends."""
        self._world = world
        self._on_idle = on_idle
        self._news = threading.Condition()
        self._queues: dict[Any, deque[_Request[Any]]] = {}
        """The waiting requests of each lobby; the first lobby is served next."""
        self._running = False

    def run_work(self, work: Callable[[], T]) -> T:
        """Do work in the thread while the running job waits; returns its value or raises its exception."""
        scheduler = self._world.scheduler
        charged_context, request = scheduler.running().charged_context, _Request(scheduler, work)
        self._add(charged_context, request)
        try:
            return request.answer.wait()
        finally:
            if not request.answer.done:
                self._cancel(charged_context, request)

    def _add(self, lobby: Any, request: _Request[Any]) -> None:
        with self._news:
            self._queues.setdefault(lobby, deque()).append(request)
            if not self._running:
                self._running = True
                threading.Thread(target=self._serve, name="urbihw-worker", daemon=True).start()
            self._news.notify()

    def _cancel(self, lobby: Any, request: _Request[Any]) -> None:
        """Remove a request for which no job waits any more."""
        with self._news, contextlib.suppress(KeyError, ValueError):
            self._queues[lobby].remove(request)

    def _serve(self) -> None:
        while (request := self._next()) is not None:
            request.execute()

    def _next(self) -> _Request[Any] | None:
        """The next request; None after an idle time of ``IDLE_TIMEOUT_S`` seconds, which ends the thread."""
        with self._news:
            while True:
                while self._queues:
                    lobby = next(iter(self._queues))
                    queue = self._queues.pop(lobby)
                    if queue:
                        request = queue.popleft()
                        if queue:
                            self._queues[lobby] = queue
                        return request
                if not self._news.wait(IDLE_TIMEOUT_S) and not self._queues:
                    self._on_idle()
                    self._running = False
                    return None
