"""What the cycle thinks of one device: ok, suspect, lost or back. Pure: time comes in as an argument.

    ok --a miss--> suspect --LOST_AFTER misses in a row--> lost --answers a probe--> back --answers again--> ok
                      `--an answer--> ok

A suspect is still asked each time its data is due, behind the others. A lost device is left out and pinged every
PROBE_PERIOD: at 100 Hz it is found lost after 30 ms and found back within 0.3 s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

State = Literal["ok", "suspect", "lost", "back"]

LOST_AFTER: Final = 3
PROBE_PERIOD: Final = 0.25


@dataclass(frozen=True, slots=True)
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

    def answered(self) -> Change | None:
        """Note a good answer to an ordinary question."""
        if self.state == "ok":
            return None
        self._misses = 0
        return self._change("ok", "answers")

    def missed(self, now: float, reason: str) -> Change | None:
        """Note that an answer stayed out, or came damaged, for `reason`."""
        self._misses += 1
        if self.state == "lost":
            return None
        if self._misses >= LOST_AFTER:
            self.next_probe = now + PROBE_PERIOD
            return self._change("lost", reason)
        return None if self.state == "suspect" else self._change("suspect", reason)

    def declare_lost(self, now: float, reason: str) -> Change | None:
        """Note that the device is not there at all, for instance after the adapter came back without it."""
        self._misses = LOST_AFTER
        self.next_probe = now + PROBE_PERIOD
        return None if self.state == "lost" else self._change("lost", reason)

    def probed(self, now: float, answered: bool) -> Change | None:
        """Note the outcome of a probe of a lost device."""
        if not answered:
            self.next_probe = now + PROBE_PERIOD
            return None
        self._misses = 0
        return self._change("back", "answers again")

    def _change(self, new: State, reason: str) -> Change:
        change = Change(self.state, new, reason)
        self.state = new
        return change
