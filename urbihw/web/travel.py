"""How long the orders of a browser were on their way, by its own clock: old ones must not move the robot."""

from __future__ import annotations

from typing import Final

DRIFT: Final = 2e-4
"""Seconds in a second by which two clocks run apart at most."""


class Travel:
    """How much longer messages travel than the quickest one: the clocks have no common beginning."""

    def __init__(self) -> None:
        self._least: float | None = None
        self._looked_at = 0.0

    def delay(self, sent: float, now: float) -> float:
        """Seconds that a message was held up; ``sent`` by the clock of the browser, ``now`` by one's own, s."""
        taken = now - sent
        least = taken if self._least is None else min(taken, self._least + DRIFT * (now - self._looked_at))
        self._least, self._looked_at = least, now
        return taken - least

    def begin_again(self) -> None:
        """Forget the quickest one: a computer that was asleep may have stopped its clock."""
        self._least = None
