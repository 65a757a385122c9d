"""Reloads the settings while the robot is served (SIGHUP).

An invalid file causes one line in the log, and the settings in force stay.  All settings are checked before any is
changed, so none is applied halfway.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection
from typing import Final

from urbihw.daemon.config import Config, Loaded
from urbihw.kernel.uobject import BadConfig

log = logging.getLogger("urbihw.daemon")

RELOAD_INTERVAL_S: Final = 1.0
"""Minimum seconds between two reloads: each blocks all clients for some milliseconds, and writes lines to the log."""
LIVE_SETTINGS: Final = frozenset(
    ("rate", "hold_limit", "dead_man", "torque_off_on_stop", "on_disconnect", "on_lost", "limits", "options")
)
"""The settings that change at once.  Those ``options`` that matter for finding the robot take effect when it is found
again."""
ROBOT_TABLES: Final = ("limits", "options", "devices")
"""The tables about the robot itself."""


def check_whole(served: Config, read: Loaded) -> None:
    """Raise BadConfig for a file that lacks as a whole what is in force: an editor may be writing it just now.

    What is to be gone must be said: by an empty table.
    """
    if read.file and not read.in_file and read.config != served:
        raise BadConfig(f"{read.file}: is empty: read it again when it is written (no limits are a bare [limits])")
    there = {*read.in_file, *read.flags}
    lost = [f"[{table}]" for table in ROBOT_TABLES if getattr(served, table) and table not in there]
    if lost:
        raise BadConfig(
            f"{read.file}: has no {' and no '.join(lost)}, unlike the settings in force: read it again when it is "
            f"written, or write {' and '.join(lost)} without rows"
        )


def restart_settings(served: Config, read: Config) -> Collection[str]:
    """The changed settings that take effect at the next start only."""
    return [key for key in Config.rules() if key not in LIVE_SETTINGS and getattr(served, key) != getattr(read, key)]


class Reloader:
    """Calls ``read`` on request: at once, but at most once in ``RELOAD_INTERVAL_S``.

    Further requests in that time are combined into one at its end, so the last one is never lost.  Requests before
    ``begin`` wait for it.
    """

    def __init__(self, read: Callable[[], None]) -> None:
        self._read = read
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._next = self._loop.time()
        self._asked = False
        self._begun = False

    def request_reload(self) -> None:
        """Request a reload; called in the loop's thread."""
        self._asked = True
        if self._begun and self._timer is None:
            self._timer = self._loop.call_at(max(self._next, self._loop.time()), self._due)

    def begin(self) -> None:
        """Start to serve requests: from now on settings can be applied."""
        self._begun = True
        if self._asked:
            self.request_reload()

    def end(self) -> None:
        """Stop serving requests.  A second call does nothing."""
        self._begun = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _due(self) -> None:
        self._timer, self._asked = None, False
        self._next = self._loop.time() + RELOAD_INTERVAL_S
        self._read()
