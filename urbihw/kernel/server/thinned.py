"""A log that a client cannot fill: what repeats is counted and told once a minute."""

from __future__ import annotations

import asyncio
import logging
from typing import Final

PERIOD: Final = 60.0
"""Seconds between two lines of one kind."""
MOST_KINDS: Final = 64


class Thinned:
    """Warnings of kinds; the first of a kind is logged at once, and those of the following minute by their number.

    A loop of asyncio must run.
    """

    def __init__(self, log: logging.Logger, period: float = PERIOD) -> None:
        self._log = log
        self._period = period
        self._more: dict[str, int] = {}
        self._timers: dict[str, asyncio.TimerHandle] = {}

    def warning(self, kind: str, text: str) -> None:
        """Tell of something; ``text`` is logged if nothing of that kind was logged lately."""
        if kind not in self._more and len(self._more) >= MOST_KINDS:
            kind = "other warnings"
        if kind in self._more:
            self._more[kind] += 1
            return
        self._log.warning("%s", text)
        self._begin(kind)

    def close(self) -> None:
        """Tell of what was only counted so far."""
        for timer in self._timers.values():
            timer.cancel()
        for kind in self._more:
            self._tell(kind)
        self._more.clear()
        self._timers.clear()

    def _begin(self, kind: str) -> None:
        self._more[kind] = 0
        self._timers[kind] = asyncio.get_running_loop().call_later(self._period, self._over, kind)

    def _over(self, kind: str) -> None:
        if self._tell(kind):
            self._begin(kind)
        else:
            del self._more[kind], self._timers[kind]

    def _tell(self, kind: str) -> bool:
        more = self._more[kind]
        if more:
            self._log.warning("%s: and %d more", kind, more)
        return more > 0
