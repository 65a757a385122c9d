"""Ticks at absolute deadlines: they neither drift nor come in bursts."""

from __future__ import annotations


class Ticker:
    """Says when the next tick is due.

    Attributes:
        period: seconds between ticks.
        due: time of the next tick.
    """

    def __init__(self, period: float, now: float) -> None:
        self.period = period
        self.due = now

    def advance(self, now: float) -> int:
        """Go on to the next tick that is not yet over at `now`; return how many were skipped as too late."""
        self.due += self.period
        behind = now - self.due
        if behind <= 0:
            return 0
        # A tick that is due this very moment is not late; only whole periods are lost.
        skipped = int(behind / self.period)
        if behind > skipped * self.period:
            skipped += 1
        self.due += skipped * self.period
        return skipped
