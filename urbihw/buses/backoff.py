"""Pauses before one tries again, which double each time up to a longest one."""

from __future__ import annotations


class BackOff:
    """How long to wait before the next try: ``first`` s, then twice as long each time, ``longest`` s at most.

    With ``at_once`` the first try after a success waits for nothing.
    """

    def __init__(self, first: float, longest: float, *, at_once: bool = False) -> None:
        self._first = first
        self._longest = longest
        self._start = 0.0 if at_once else first
        self._next = self._start

    def next_pause(self) -> float:
        """Seconds to wait before the next try; the one after that waits longer."""
        pause = self._next
        self._next = min(max(self._first, 2 * pause), self._longest)
        return pause

    def reset(self) -> None:
        """A try succeeded: the next failure begins with the first pause again."""
        self._next = self._start
