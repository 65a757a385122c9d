"""Releases of the control socket that are answered when the daemon knows them, so that a write behind the answer moves.

Who reads the answer may write to the robot at once, by another connection, to the daemon.  The worker has told the
daemon, but that may not have read it yet, and would refuse the write.  The daemon may be held, or gone, so an answer
waits for ``LONGEST_WAIT_S`` at most.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final

LONGEST_WAIT_S: Final = 0.25
"""Seconds for which an answer waits for the daemon."""


class OwedReleases:
    """The answers that wait, oldest first."""

    def __init__(self, now: Callable[[], float]) -> None:
        """``now`` is the clock of the engine."""
        self._now = now
        self._waiting: deque[tuple[float, Callable[[], None]]] = deque()
        self._unheard = 0
        """Reports of a release that the daemon has not confirmed, those whose answer is given included."""

    def wait(self, answer: Callable[[], None]) -> None:
        """The daemon is being told of a release: call ``answer`` when it knows."""
        self._unheard += 1
        self._waiting.append((self._now() + LONGEST_WAIT_S, answer))

    def confirm(self) -> None:
        """The daemon knows of the oldest release that it had not confirmed."""
        self._unheard = max(0, self._unheard - 1)  # it may be one of the worker before this one
        while len(self._waiting) > self._unheard:
            self._waiting.popleft()[1]()

    def answer_late(self) -> None:
        """Answer those that have waited for long enough."""
        while self._waiting and self._waiting[0][0] <= self._now():
            self._waiting.popleft()[1]()
