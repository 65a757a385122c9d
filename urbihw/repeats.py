"""Rate limiting for logs: the first few events of a kind in a period pass, the others are only counted."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Hashable
from typing import Final, NamedTuple

PERIOD: Final = 60.0
"""Seconds of a period; at its end the number of repetitions is reported."""
MAX_KINDS: Final = 64
"""Maximum number of kinds of lines that a ``LimitedLog`` counts apart; all further ones share one kind."""

Later = Callable[[float, Callable[[], None]], Callable[[], None]]
"""Starts a timer: calls the function once after so many seconds.  Returns a function that cancels it."""


class _Period(NamedTuple):
    """The events of one key: how many passed, how many were held back, and the function that cancels the timer."""

    passed: int
    held: int
    cancel: Callable[[], None]


class Repeats:
    """Limits events by key; calls ``report(key, held)`` at the end of a period in which events of a key were held
    back."""

    def __init__(self, later: Later, report: Callable[[Hashable, int], None], period: float = PERIOD) -> None:
        """``later`` starts a timer in the thread that uses the object; ``period`` is in seconds."""
        self._later = later
        self._report = report
        self._period = period
        self._periods: dict[Hashable, _Period] = {}

    def __contains__(self, key: Hashable) -> bool:
        """Whether the period of a key is running."""
        return key in self._periods

    def __len__(self) -> int:
        """The number of keys whose period is running."""
        return len(self._periods)

    def admit(self, key: Hashable, most: int = 1) -> bool:
        """Count an event; true if it is among the first ``most`` of its period, which begins with the first event."""
        counted = self._periods.get(key)
        if counted is None:
            counted = _Period(0, 0, self._later(self._period, lambda: self._end(key)))
        free = counted.passed < most
        self._periods[key] = counted._replace(passed=counted.passed + free, held=counted.held + (not free))
        return free

    def close(self) -> None:
        """End all periods, and report the events that were only counted so far."""
        for key in list(self._periods):
            self._periods[key].cancel()
            self._end(key)

    def _end(self, key: Hashable) -> None:
        counted = self._periods.pop(key)
        if counted.held:
            self._report(key, counted.held)


class LimitedLog:
    """A log that clients cannot fill: the first lines of a kind are logged at once, and at the end of the minute the
    number of further ones, with the last of them.  Use it in the thread of an asyncio loop."""

    def __init__(self, log: logging.Logger, period: float = PERIOD) -> None:
        """``period`` is in seconds."""
        self._log = log
        self._repeats = Repeats(_call_later, self._log_count, period)
        self._last: dict[Hashable, str] = {}

    def say(self, kind: Hashable, text: str, *values: object, level: int = logging.WARNING, most: int = 1) -> None:
        """Log a line, if it is one of the first ``most`` of its kind in this period."""
        if kind not in self._repeats and len(self._repeats) >= MAX_KINDS:
            kind = None
        line = text % values if values else text
        if self._repeats.admit(kind, most):
            self._log.log(level, "%s", line)
        else:
            self._last[kind] = line

    def close(self) -> None:
        """Log the numbers of the lines that were only counted so far."""
        self._repeats.close()

    def _log_count(self, kind: Hashable, held: int) -> None:
        self._log.warning("%d more like this in a minute: %s", held, self._last.pop(kind))


def _call_later(seconds: float, call: Callable[[], None]) -> Callable[[], None]:
    return asyncio.get_running_loop().call_later(seconds, call).cancel
