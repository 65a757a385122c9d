"""The health of one device: ok, suspect, lost or back. No I/O and no clock: time is an argument.

    ok --a miss--> suspect --LOST_AFTER misses in a row--> lost --answers a probe--> back --answers again--> ok
                      `--an answer--> ok

A suspect device is still read whenever its data is due, after the others. A lost device is only pinged, every
PROBE_PERIOD s: at 100 Hz a loss is noticed after 30 ms, and a return within 0.3 s.
"""

from __future__ import annotations

from typing import Final, Literal

from urbihw.frozen import frozen

State = Literal["ok", "suspect", "lost", "back"]

LOST_AFTER: Final = 3
PROBE_PERIOD: Final = 0.25


@frozen
class Change:
    """A device went from one state to another, and why."""

    old: State
    new: State
    reason: str


class Health:
    """The state of one device.

    Attributes:
        state: see above.
        next_probe: when a lost device is to be pinged again.
    """

    def __init__(self) -> None:
        self.state: State = "ok"
        self.next_probe = 0.0
        self._misses = 0

    def record_answer(self) -> Change | None:
        """Record a valid answer to a read."""
        if self.state == "ok":
            return None
        self._misses = 0
        return self._change("ok", "answers")

    def record_miss(self, now: float, reason: str) -> Change | None:
        """Record that an answer was missing or damaged, for `reason`."""
        self._misses += 1
        if self.state == "lost":
            return None
        if self._misses >= LOST_AFTER:
            self.next_probe = now + PROBE_PERIOD
            return self._change("lost", reason)
        return None if self.state == "suspect" else self._change("suspect", reason)

    def declare_lost(self, now: float, reason: str) -> Change | None:
        """Record that the device is absent, for instance after the link came back without it."""
        self._misses = LOST_AFTER
        self.next_probe = now + PROBE_PERIOD
        return None if self.state == "lost" else self._change("lost", reason)

    def record_probe(self, now: float, answered: bool) -> Change | None:
        """Record the outcome of a probe of a lost device."""
        if not answered:
            self.next_probe = now + PROBE_PERIOD
            return None
        self._misses = 0
        return self._change("back", "answers again")

    def _change(self, new: State, reason: str) -> Change:
        change = Change(self.state, new, reason)
        self.state = new
        return change
