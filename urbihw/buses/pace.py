"""Why a bus does not keep its rate, and what to do, in one line; no I/O.

The line stands in the log, in the verdict on the health (``urbihw health``, the panel), and in ``urbihw doctor``.
"""

from __future__ import annotations

from typing import Final

from urbihw.frozen import frozen

LATE_SHARE: Final = 0.01
"""Share of missed ticks from which on a rate is not kept."""
_BUSY_SHARE: Final = 0.1
"""Share of the time without a processor from which on the computer is the cause."""
_FULL_WIRE: Final = 0.85
"""Share of the time with bytes on the wire from which on the wire is the cause."""
_SLOW_ANSWER_S: Final = 0.0002
_LONGEST_RETURN_DELAY_S: Final = 0.0007
"""Mean turnarounds above the first are worth a word; those above the second are more than servos wait for."""
_SLOW_SECONDS: Final = 5
"""Seconds in a row without the rate before there is a line: a start, or a short load of the computer, is no news."""
_GOOD_SECONDS: Final = 60
"""Seconds in a row with the rate after which there may be another line."""


@frozen
class Pace:
    """What a bus did with its time.

    Attributes:
        wanted, rate: ticks per second, asked for and achieved.
        late: share of the ticks that were missed, 0..1.
        load: share of the time in which bytes were on the wire, 0..1.
        turnaround: mean time in s that a device takes to answer, without that of the bytes; 0 if unknown.
        held_up: share of the time in which the worker had something to do and no processor, 0..1.
        crowd: programs that want each processor of this machine; 0 if unknown.
    """

    wanted: float
    rate: float
    late: float
    load: float = 0.0
    turnaround: float = 0.0
    held_up: float = 0.0
    crowd: float = 0.0

    @property
    def is_kept(self) -> bool:
        """Whether the rate is as asked, but for what is too little to be told."""
        return self.late <= LATE_SHARE

    @property
    def is_held_up(self) -> bool:
        """Whether the worker itself had too little of a processor."""
        return self.held_up > _BUSY_SHARE

    def busy_words(self) -> str:
        """Return that this computer is busy, if it is, else "": then answers may be late."""
        if self.is_held_up:
            return f"this computer is busy (no processor for {100 * self.held_up:.0f} % of the time)"
        return busy_words(self.crowd)

    def explain(self) -> str:
        """Return the line for a rate that is not kept: how long a cycle takes, the rate, and what to do."""
        if self.rate <= 0:
            return f"no cycle of the bus has ended; {self.wanted:.0f} Hz were asked for"
        cycle = f"a cycle takes {1000 / self.rate:.1f} ms, so {self.rate:.0f} Hz of {self.wanted:.0f}"
        return f"{cycle}: {self._remedy()} or set rate = {_lower_rate(self.rate):g}"

    def _remedy(self) -> str:
        if self.is_held_up:
            return f"{self.busy_words()}: end other programs"
        if self.load > _FULL_WIRE:
            return f"the wire is full ({100 * self.load:.0f} %): choose a faster baud rate"
        if busy := busy_words(self.crowd):
            return f"{busy}: end other programs"
        if self.turnaround > _LONGEST_RETURN_DELAY_S:
            return (f"each answer takes {1000 * self.turnaround:.1f} ms: look for a slow adapter (stop the daemon, "
                    "urbihw doctor URL --mend)")
        if self.turnaround > _SLOW_ANSWER_S:
            return "shorten the return delay (stop the daemon, urbihw doctor URL --mend)"
        return "this computer is too slow for it: watch fewer values"


def busy_words(crowd: float) -> str:
    """Return that this computer is busy, if more programs want it than it has processors, else "": then a late answer
    says nothing about cables, adapters and servos."""
    return f"this computer is busy ({crowd:.1f} programs for each processor)" if crowd > 1 else ""


def _lower_rate(rate: float) -> float:
    """Return a round rate that is a little lower, so that it is kept; at least 1."""
    kept = 0.98 * rate
    step = 5 if kept >= 20 else 1
    return max(kept // step * step, 1)


class PaceWatch:
    """Finds out, second by second, when there is something to tell."""

    def __init__(self) -> None:
        self._slow = self._good = 0
        self._is_told = False

    def hear(self, second: Pace) -> str:
        """Return the line to tell after this second, "" for none: one for each time without the rate."""
        if second.is_kept:
            self._slow, self._good = 0, self._good + 1
            self._is_told = self._is_told and self._good < _GOOD_SECONDS
            return ""
        self._slow, self._good = self._slow + 1, 0
        if self._is_told or self._slow < _SLOW_SECONDS:
            return ""
        self._is_told = True
        return second.explain()
