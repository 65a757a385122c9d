"""Exponential back-off: pauses between retries, which double each time up to a maximum."""

from __future__ import annotations


class BackOff:
    """Computes the pauses between retries: ``first`` s, then twice as long each time, at most ``longest`` s.

    With ``at_once`` the first retry after a success does not wait.
    """

    def __init__(self, first: float, longest: float, *, at_once: bool = False) -> None:
        self._first = min(first, longest)
        self._longest = longest
        self._start = 0.0 if at_once else self._first
        self._next = self._start

    def next_pause(self) -> float:
        """Seconds to wait before the next retry; the pause after it is longer."""
        pause = self._next
        self._next = min(max(self._first, 2 * pause), self._longest)
        return pause

    def reset(self) -> None:
        """Start again with the first pause, after a success."""
        self._next = self._start
