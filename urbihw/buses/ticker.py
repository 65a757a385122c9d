"""Ticks at absolute deadlines, without drift and without bursts after a delay."""

from __future__ import annotations


class Ticker:
    """Computes the time of the next tick.

    Attributes:
        period: seconds between ticks.
        due: time of the next tick.
    """

    def __init__(self, period: float, now: float) -> None:
        self.period = period
        self.due = now

    def advance(self, now: float) -> int:
        """Advance to the next tick at or after `now`; return how many ticks were skipped."""
        self.due += self.period
        behind = now - self.due
        if behind <= 0:
            return 0
        # A tick that is due exactly at `now` is not late; only whole periods count as skipped.
        skipped = int(behind / self.period)
        if behind > skipped * self.period:
            skipped += 1
        self.due += skipped * self.period
        return skipped
