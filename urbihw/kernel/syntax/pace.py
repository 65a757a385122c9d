"""Lets long work yield to other jobs: the parser and the compiler count their steps and pause from time to time."""

from __future__ import annotations

from collections.abc import Callable

STEPS_PER_PAUSE = 64
"""Steps between two pauses.  A step is what one node costs in one pass, 5 to 30 microseconds."""


def no_pause() -> None:
    """The pause of short work: does nothing."""


class StepPace:
    """Counts steps and calls ``pause`` after each ``STEPS_PER_PAUSE`` of them.  If ``pause`` raises, the work is
    abandoned."""

    __slots__ = ("_left", "pause")

    def __init__(self, pause: Callable[[], None] = no_pause) -> None:
        self.pause = pause
        self._left = STEPS_PER_PAUSE

    def step(self, count: int = 1) -> None:
        """Count one more step, or several at once."""
        self._left -= count
        if self._left <= 0:
            self._left = STEPS_PER_PAUSE
            self.pause()
