"""Long work that gives way to others: who reads or compiles counts what it does, and pauses from time to time."""

from __future__ import annotations

from collections.abc import Callable

EVERY = 64
"""Steps between two pauses.  A step is what one node costs in one pass, 5 to 30 microseconds."""


def no_pause() -> None:
    """What short work does between its steps: nothing."""


class Pace:
    """Counts steps; ``pause`` is called after each ``EVERY`` of them.  It may raise: then the work is given up."""

    __slots__ = ("_left", "pause")

    def __init__(self, pause: Callable[[], None] = no_pause) -> None:
        self.pause = pause
        self._left = EVERY

    def step(self, count: int = 1) -> None:
        """One more step is done, or several at once."""
        self._left -= count
        if self._left <= 0:
            self._left = EVERY
            self.pause()
