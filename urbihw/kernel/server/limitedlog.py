"""A rate-limited log that a client cannot fill: repetitions are counted, and their number is logged once a minute."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Hashable
from typing import Final

from urbihw.repeats import PERIOD, Repeats

MAX_KINDS: Final = 64


class LimitedLog:
    """Logs the first warning of each kind at once, and the number of further ones at the end of the minute.

    Use it in the thread of an asyncio loop.
    """

    def __init__(self, log: logging.Logger, period: float = PERIOD) -> None:
        """``period`` is the length of a period in seconds."""
        self._log = log
        self._repeats = Repeats(_call_later, self._log_count, period)

    def warning(self, kind: str, text: str) -> None:
        """Log ``text``, unless a warning of the same kind was logged in the current period."""
        if kind not in self._repeats and len(self._repeats) >= MAX_KINDS:
            kind = "other warnings"
        if self._repeats.admit(kind):
            self._log.warning("%s", text)

    def close(self) -> None:
        """Log the numbers of the warnings that were only counted so far."""
        self._repeats.close()

    def _log_count(self, kind: Hashable, more: int) -> None:
        self._log.warning("%s: and %d more", kind, more)


def _call_later(seconds: float, action: Callable[[], None]) -> Callable[[], None]:
    return asyncio.get_running_loop().call_later(seconds, action).cancel
