"""The log of a robot: what many devices do at once is one line, and what is said again and again is counted.

A bus whose power goes takes eighteen servos with it, and a plug that is loose is lost and back many times a second.
Neither may fill the log, nor keep a line from it that says something new.
"""

from __future__ import annotations

import itertools
import logging
import re
from collections.abc import Callable, Hashable, Iterable
from typing import Any, Final, NamedTuple

QUIET: Final = 0.3
"""Seconds without a further device after which it is told which ones it was."""
LONGEST: Final = 2.0
"""Seconds after which it is told at the latest."""
PERIOD: Final = 60.0
"""Seconds in which repetitions are counted; then their number is told."""
SAME: Final = 3
"""How often the same line is logged in a period."""
ALIKE: Final = 30
"""How many lines that differ in their values only."""

Later = Callable[[float, Callable[[], None]], Callable[[], None]]
"""Do something once, after so many seconds; gives what takes that back."""


class News(NamedTuple):
    """What can happen to one device or to many, with {who}, {why} and {count}.

    Why it happened to many is added only if it is the same for all.
    """

    one: str
    many: str


LOST: Final = News("{who} is lost: {why}", "{count} devices are lost: {who}")
BACK: Final = News("{who} is back", "{count} devices are back: {who}")


class _Run(NamedTuple):
    """Lines of one kind in a period: how many were logged, how many held back, and what takes back its end."""

    said: int
    held: int
    cancel: Callable[[], None]


class DeviceLog:
    """See the head of this file.  In the thread of the kernel, whose timers ``later`` uses."""

    def __init__(self, log: logging.Logger, now: Callable[[], float], later: Later) -> None:
        self._log = log
        self._now = now
        self._later = later
        self._runs: dict[Hashable, _Run] = {}
        self._news: dict[News, dict[str, str]] = {}
        self._since = 0.0
        self._cancel_news: Callable[[], None] = lambda: None

    def info(self, text: str, *values: Any) -> None:
        """Log what is good to know."""
        self._say(logging.INFO, text, values)

    def warning(self, text: str, *values: Any) -> None:
        """Log what may need somebody's attention."""
        self._say(logging.WARNING, text, values)

    def error(self, text: str, *values: Any) -> None:
        """Log what does not work."""
        self._say(logging.ERROR, text, values)

    def tell(self, news: News, who: str, why: str = "") -> None:
        """Log what happened to a device, together with those to which the same happens at this time."""
        now = self._now()
        if not self._news:
            self._since = now
        self._cancel_news()
        gathered = self._news.pop(news, {})
        self._news[news] = gathered | {who: why}
        self._cancel_news = self._later(max(0.0, min(QUIET, self._since + LONGEST - now)), self._tell_all)

    def close(self) -> None:
        """Log all that waits."""
        self._cancel_news()
        self._tell_all()
        for key in list(self._runs):
            self._runs[key].cancel()
            self._end(key)

    # ---------------------------------------------------------------- inside

    def _tell_all(self) -> None:
        gathered, self._news = self._news, {}
        for news, devices in gathered.items():
            count, reasons = len(devices), set(devices.values())
            why = reasons.pop() if len(reasons) == 1 else ""
            words = news.one if count == 1 else news.many + (" ({why})" if why else "")
            self._log_thinned(logging.WARNING, words, words.format(who=together(devices), why=why, count=count))

    def _say(self, level: int, text: str, values: tuple[Any, ...]) -> None:
        self._log_thinned(level, text, text % values)

    def _log_thinned(self, level: int, kind: str, line: str) -> None:
        if (line in self._runs or self._counted((kind,), ALIKE)) and self._counted(line, SAME):
            self._log.log(level, "%s", line)

    def _counted(self, key: Hashable, most: int) -> bool:
        """Count a line; whether it may still be logged."""
        run = self._runs.get(key)
        if run is None:
            run = _Run(0, 0, self._later(PERIOD, lambda: self._end(key)))
        free = run.said < most
        self._runs[key] = run._replace(said=run.said + free, held=run.held + (not free))
        return free

    def _end(self, key: Hashable) -> None:
        """A period is over."""
        run = self._runs.pop(key)
        if not run.held:
            return
        if isinstance(key, str):
            self._log.warning("%s (%d times more)", key, run.held)
        else:
            self._log.warning("and %d lines more of the kind: %s", run.held, *key)  # type: ignore[misc]


def together(names: Iterable[str]) -> str:
    """Names of devices in short: ``motor 1-18, sensor 100``."""
    groups: dict[str, list[int]] = {}
    for name in names:
        word, _, number = name.rpartition(" ")
        if re.fullmatch("[0-9]+", number):
            groups.setdefault(word, []).append(int(number))
        else:
            groups.setdefault(name, [])
    return ", ".join(f"{word} {_ranges(numbers)}".strip() for word, numbers in groups.items())


def _ranges(numbers: Iterable[int]) -> str:
    parts = []
    for _, run in itertools.groupby(enumerate(sorted(set(numbers))), lambda pair: pair[1] - pair[0]):
        row = [number for _, number in run]
        parts.append(f"{row[0]}-{row[-1]}" if len(row) > 1 else str(row[0]))
    return ", ".join(parts)
