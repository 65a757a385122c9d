"""Long work in a thread, whose result returns to the kernel's thread and is dropped once it is obsolete."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

THREAD_NAME = "planner"


class Background:
    """One piece of work at a time: a newer one begins when the thread of the older one has ended, whose result is
    dropped.

    Attributes:
        busy: a piece of work was begun, and its result has not come.
    """

    def __init__(self, post: Callable[[Callable[[], None]], None], expected: tuple[type[Exception], ...]) -> None:
        """``post`` runs a function in the kernel's thread; ``expected`` are the failures that are no bug."""
        self.busy = False
        self._post = post
        self._expected = expected
        self._task = 0
        self._has_thread = False
        self._next: Callable[[], None] | None = None

    def drop(self) -> None:
        """Drop the result of the work that runs, and the work that waits for it to end."""
        self._task += 1
        self._next = None
        self.busy = False

    def start(self, work: Callable[[], Any], done: Callable[[Any], None], failed: Callable[[Exception], None]) -> None:
        """Run some work in a thread; ``done`` or ``failed`` is called only if no other work was begun meanwhile."""
        self.drop()
        self.busy = True
        task = self._task

        def receive(act: Callable[[Any], None], value: Any) -> None:
            self._has_thread = False
            following, self._next = self._next, None
            if following is not None:
                following()
            elif task == self._task:
                self.busy = False
                act(value)

        def run() -> None:
            try:
                value = work()
            except self._expected as error:
                failure: Exception = error
                self._post(lambda: receive(failed, failure))
            except Exception as error:
                failure = RuntimeError(f"our bug: {type(error).__name__}: {error}")
                self._post(lambda: receive(failed, failure))
            else:
                self._post(lambda: receive(done, value))

        def begin() -> None:
            self._has_thread = True
            threading.Thread(target=run, name=THREAD_NAME, daemon=True).start()

        if self._has_thread:
            self._next = begin
        else:
            begin()
