"""How long a worker has been silent, and whether it hangs: one that only waits for a processor does not.

On a loaded machine a worker may wait seconds for its turn. To replace it then would cost the start of another one,
which gets no more of the processor than this one, again and again. So the time in which it had something to do and no
processor does not count, up to `MOST_CREDIT` times the time that is allowed: a worker that computes for ever beside
others has to end, too.
"""

from __future__ import annotations

from typing import Final

CHECK_PERIOD_S: Final = 0.1
"""Seconds between two checks for silence of the worker."""
SUSPENDED_AFTER_S: Final = 0.3
"""Seconds that a check may be late; a longer delay means that this process itself was suspended."""
MOST_CREDIT: Final = 5.0
"""Greatest time that does not count, as a multiple of the allowed one."""


class Silence:
    """The silence of a worker; times in s, `held_up` is the time for which the worker has waited for a processor, None
    while it is unknown: then what was known last counts."""

    def __init__(self, now: float, held_up: float | None) -> None:
        self._heard_at = self._looked_at = now
        self._held_before = held_up
        self.lasted = 0.0
        self._held_up = 0.0

    def look(self, now: float, held_up: float | None) -> None:
        """The worker is still silent."""
        if now - self._looked_at > CHECK_PERIOD_S + SUSPENDED_AFTER_S:
            # This process was suspended, perhaps the worker too: give the worker a full time-out again.
            self._heard_at, self._held_before, self._held_up = now, held_up, 0.0
        self._looked_at = now
        self.lasted = now - self._heard_at
        if held_up is None:
            return
        if self._held_before is None:
            self._held_before = held_up
        self._held_up = held_up - self._held_before

    def hangs(self, allowed: float) -> bool:
        """Whether it has had a processor, or waited for something else, for longer than is allowed."""
        return self.lasted - min(self._held_up, MOST_CREDIT * allowed) >= allowed
