"""Ticks at absolute deadlines: without drift, without bursts after a delay, and as often as the work allows.

A tick that ends in time lets the next one begin at its deadline. One that ends too late lets it begin at once, and all
later deadlines move with it. Waiting for the next multiple of the period instead would halve the rate of a bus whose
tick takes a little longer than a period.
"""

from __future__ import annotations

from typing import Final

LEAST_GAP_S: Final = 0.0001
"""Shortest pause between two ticks: the worker sleeps in it, however late it is, so that other programs have a turn."""


class Ticker:
    """Computes the time of the next tick.

    Attributes:
        period: seconds between ticks that are in time.
        due: time of the next tick.
    """

    def __init__(self, period: float, now: float) -> None:
        self.period = period
        self.due = now
        self._behind = 0.0
        """Seconds by which deadlines have moved, less those of the missed ticks that were counted."""

    def advance(self, now: float) -> int:
        """Advance to the next tick, when one has ended at `now`; return how many whole ticks were missed.

        Delays of less than a tick add up. Missed ticks are not made up for.
        """
        self.due += self.period
        soonest = now + LEAST_GAP_S
        if soonest <= self.due:
            return 0
        self._behind += soonest - self.due
        self.due = soonest
        missed = int(self._behind / self.period)
        self._behind -= missed * self.period
        return missed
