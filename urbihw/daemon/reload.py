"""Settings that are read again while the robot is served (SIGHUP).

A file that cannot be used is one line in the log, and what is in force stays.  Nothing is half applied: all is checked
before anything changes.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection
from typing import Final

from urbihw.daemon.config import Config

log = logging.getLogger("urbihw.daemon")

INTERVAL: Final = 1.0
"""Seconds between two readings: each takes some milliseconds of everybody's time, and lines of the log."""
LIVE: Final = frozenset(("rate", "dead_man", "torque_off_on_stop", "on_disconnect", "on_lost", "limits", "options"))
"""The settings that change at once.  Of ``options`` those of finding the robot count when it is found again."""


def waiting(served: Config, read: Config) -> Collection[str]:
    """The settings that were changed and need a new start."""
    return [key for key in Config.rules() if key not in LIVE and getattr(served, key) != getattr(read, key)]


class Reloader:
    """Calls ``read`` when it is asked to: at once, and at most once in ``INTERVAL``.

    Several requests in that time become one, at its end, so the last one is never lost.  Requests before ``begin`` wait
    for it.
    """

    def __init__(self, read: Callable[[], None]) -> None:
        self._read = read
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._next = self._loop.time()
        self._asked = False
        self._begun = False

    def ask(self) -> None:
        """Read the settings again; called in the loop's thread."""
        self._asked = True
        if self._begun and self._timer is None:
            self._timer = self._loop.call_at(max(self._next, self._loop.time()), self._due)

    def begin(self) -> None:
        """From now on there is something that can take settings."""
        self._begun = True
        if self._asked:
            self.ask()

    def end(self) -> None:
        """No more; twice is fine."""
        self._begun = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _due(self) -> None:
        self._timer, self._asked = None, False
        self._next = self._loop.time() + INTERVAL
        self._read()
