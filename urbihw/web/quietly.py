"""Lines of the log that others can cause as often as they like: each kind once in a minute, then how many more."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Hashable
from typing import Final

from urbihw.repeats import Repeats

MAX_KINDS: Final = 64
"""Kinds of lines that are counted apart; others share one."""


class Quietly:
    """Limits lines by kind.  It is used in the thread of the running loop."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._repeats = Repeats(_later, self._report)
        self._lines: dict[Hashable, str] = {}

    def say(self, kind: Hashable, text: str, *values: object, level: int = logging.WARNING, most: int = 1) -> None:
        """Log a line, if it is one of the first ``most`` of its kind in this minute."""
        if kind not in self._repeats and len(self._repeats) >= MAX_KINDS:
            kind = None
        line = text % values
        if self._repeats.admit(kind, most):
            self._log.log(level, "%s", line)
        else:
            self._lines[kind] = line

    def close(self) -> None:
        """Tell what was held back."""
        self._repeats.close()

    def _report(self, kind: Hashable, held: int) -> None:
        self._log.warning("%d more like this in a minute: %s", held, self._lines.pop(kind))


def _later(seconds: float, call: Callable[[], None]) -> Callable[[], None]:
    return asyncio.get_running_loop().call_later(seconds, call).cancel
