"""Long work that is done elsewhere: one thread for each kernel that waits for it, in which the lobbies take turns.

Who has the work done waits.  So that nobody fills the queue before his neighbours, each lobby has a queue of its own
and the thread takes one piece of work of each in turn.  The thread begins with the first piece of work and ends when
there has been none for a while.
"""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Final, Generic, TypeVar

from urbihw.kernel.runtime.world import World

T = TypeVar("T")

REST: Final = 5.0
"""Seconds without work after which the thread ends."""


class _Piece(Generic[T]):
    """Work to be done, and then what came of it."""

    def __init__(self, work: Callable[[], T], over: Callable[[], None]) -> None:
        self.work = work
        self.over = over
        self.done = False
        self.value: T | None = None
        self.error: Exception | None = None

    def do(self) -> None:
        """Do the work."""
        try:
            self.value = self.work()
        except Exception as error:
            self.error = error
        self.done = True
        self.over()


class Aside:
    """The thread and its queues."""

    def __init__(self, world: World, rests: Callable[[], None]) -> None:
        """``rests`` is called in the thread before it ends."""
        self._world = world
        self._rests = rests
        self._news = threading.Condition()
        self._queues: dict[Any, deque[_Piece[Any]]] = {}
        """The pieces that wait, of each lobby; the first lobby is the next to be served."""
        self._running = False

    def do(self, work: Callable[[], T]) -> T | None:
        """Do work in the thread while the running job waits; its value, or the exception it raised.

        What a condition reads meanwhile in another job is not taken for read by the one that waits here.
        """
        scheduler, recorder = self._world.scheduler, self._world.recorder
        job = scheduler.running()
        waits = True

        def arrived() -> None:
            if waits:
                scheduler.wake(job)

        piece = _Piece(work, lambda: scheduler.post(arrived))
        self._add(job.payer, piece)
        watch, recorder.active = recorder.active, None
        try:
            while not piece.done:
                scheduler.suspend(lambda: self._forget(job.payer, piece))
        finally:
            recorder.active = watch
            waits = False
        if piece.error is not None:
            raise piece.error
        return piece.value

    def _add(self, lobby: Any, piece: _Piece[Any]) -> None:
        with self._news:
            self._queues.setdefault(lobby, deque()).append(piece)
            if not self._running:
                self._running = True
                threading.Thread(target=self._serve, name="urbihw-aside", daemon=True).start()
            self._news.notify()

    def _forget(self, lobby: Any, piece: _Piece[Any]) -> None:
        """Nobody waits for a piece any more."""
        with self._news, contextlib.suppress(KeyError, ValueError):
            self._queues[lobby].remove(piece)

    def _serve(self) -> None:
        while (piece := self._next()) is not None:
            piece.do()

    def _next(self) -> _Piece[Any] | None:
        """The next piece of work; None when there is none for a while, and then the thread is over."""
        with self._news:
            while True:
                while self._queues:
                    lobby = next(iter(self._queues))
                    queue = self._queues.pop(lobby)
                    if queue:
                        piece = queue.popleft()
                        if queue:
                            self._queues[lobby] = queue
                        return piece
                if not self._news.wait(REST) and not self._queues:
                    self._rests()
                    self._running = False
                    return None
