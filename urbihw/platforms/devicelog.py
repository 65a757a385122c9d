"""The log of a robot: an event of many devices is one line, and repeated lines are counted.

A power failure of a bus concerns eighteen servos at once, and a loose plug is lost and back many times a second.
Neither may fill the log, nor suppress a line with new information.
"""

from __future__ import annotations

import itertools
import logging
import re
from collections.abc import Callable, Hashable, Iterable
from typing import Any, Final, NamedTuple

from urbihw.repeats import Later, Repeats

GATHER_S: Final = 0.3
"""Seconds without a further device after which the event is logged."""
MAX_GATHER_S: Final = 2.0
"""Maximum seconds until the event is logged."""
MAX_SAME: Final = 3
"""Maximum number of the same line in a period."""
MAX_ALIKE: Final = 30
"""Maximum number of lines in a period that differ only in their values."""


class DeviceEvent(NamedTuple):
    """The texts of an event of one device, and of many, with {who}, {why} and {count}; `name` is for the journal.

    The cause of an event of many is added only if it is the same for all.
    """

    one: str
    many: str
    name: str


LOST: Final = DeviceEvent("{who} is lost: {why}", "{count} devices are lost: {who}", "lost")
BACK: Final = DeviceEvent("{who} is back", "{count} devices are back: {who}", "back")


class DeviceLog:
    """Gathers an event of many devices into one line, and counts repeated lines.

    It runs in the kernel's thread; ``later`` sets the kernel's timers.  Records have the attributes ``robot``,
    ``devices`` and ``event``, which become fields of the journal (``urbihw.daemon.journal``).
    """

    def __init__(self, log: logging.Logger, now: Callable[[], float], later: Later, whose: str = "") -> None:
        """``whose`` is put before each line: the name of a second robot of the daemon, "" for the first."""
        self._whose = f"{whose}: " if whose else ""
        self._log = log
        self._now = now
        self._later = later
        self._repeats = Repeats(later, self._log_suppressed)
        self._news: dict[DeviceEvent, dict[str, str]] = {}
        self._since = 0.0
        self._cancel_news: Callable[[], None] = lambda: None

    def info(self, text: str, *values: Any, event: str = "") -> None:
        """Log information; ``event`` is the name of a kind of event."""
        self._log_text(logging.INFO, text, values, event)

    def warning(self, text: str, *values: Any, event: str = "") -> None:
        """Log a condition that may need attention."""
        self._log_text(logging.WARNING, text, values, event)

    def error(self, text: str, *values: Any, event: str = "") -> None:
        """Log a failure of the device."""
        self._log_text(logging.ERROR, text, values, event)

    def log_event(self, news: DeviceEvent, who: str, why: str = "") -> None:
        """Log an event of a device, together with the same event of other devices at this time."""
        now = self._now()
        if not self._news:
            self._since = now
        self._cancel_news()
        gathered = self._news.pop(news, {})
        self._news[news] = gathered | {who: why}
        self._cancel_news = self._later(max(0.0, min(GATHER_S, self._since + MAX_GATHER_S - now)), self._log_gathered)

    def close(self) -> None:
        """Log the pending events."""
        self._cancel_news()
        self._log_gathered()
        self._repeats.close()

    # ---------------------------------------------------------------- inside

    def _log_gathered(self) -> None:
        gathered, self._news = self._news, {}
        for news, devices in gathered.items():
            count, reasons = len(devices), set(devices.values())
            why = reasons.pop() if len(reasons) == 1 else ""
            words = news.one if count == 1 else news.many + (" ({why})" if why else "")
            line = words.format(who=join_names(devices), why=why, count=count)
            self._log_thinned(logging.WARNING, words, line, news.name, tuple(devices))

    def _log_text(self, level: int, text: str, values: tuple[Any, ...], event: str) -> None:
        self._log_thinned(level, text, text % values, event)

    def _log_thinned(self, level: int, kind: str, line: str, event: str, devices: tuple[str, ...] = ()) -> None:
        if (line in self._repeats or self._repeats.admit((kind,), MAX_ALIKE)) and self._repeats.admit(line, MAX_SAME):
            about = {"robot": self._log.name.rpartition(".")[2], "devices": devices, "event": event}
            self._log.log(level, "%s%s", self._whose, line, extra=about)

    def _log_suppressed(self, key: Hashable, held: int) -> None:
        """Log the number of suppressed repetitions of a line, or, for the 1-tuple of a kind, of its lines."""
        if isinstance(key, tuple):
            self._log.warning("%sand %d lines more of the kind: %s", self._whose, held, *key)
        else:
            self._log.warning("%s%s (%d times more)", self._whose, key, held)


def join_names(names: Iterable[str]) -> str:
    """Return names of devices in short: ``motor 1-18, sensor 100``."""
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
