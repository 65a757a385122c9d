"""The lease of a browser: what it moves stops when it says nothing for a time that it has chosen.

The daemon has the mechanism, ``lobby.lease``.  The gateway lives longer than a browser, so it gives no sign of life on
its own: it hands on those of the browser.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence

from urbihw.client.core import KEEP_ALIVE
from urbihw.web.lobby import LobbyError, LobbyLink


class BrowserLease:
    """The lease of one browser on its connections to the daemon; ``links()`` are those by which it moves the robot."""

    def __init__(self, links: Callable[[], Sequence[LobbyLink]]) -> None:
        self._links = links
        self._seconds = 0.0

    async def set_length(self, seconds: float) -> None:
        """Let the daemon stop what the browser moves after so many seconds without a message of it; 0: never.  Raises
        LobbyError."""
        before, self._seconds = self._seconds, seconds
        try:
            for link in self._links():
                await link.ask(self._text())
        except LobbyError:
            self._seconds = before
            raise

    def begin(self, link: LobbyLink) -> None:
        """Have the lease on a new connection, too.  Raises LobbyError."""
        if self._seconds:
            link.send(f"{self._text()}|;\n")

    def pass_on_life(self) -> None:
        """The browser has sent something: tell the daemon."""
        if self._seconds:
            for link in self._links():
                with contextlib.suppress(LobbyError):
                    link.send(KEEP_ALIVE)

    def _text(self) -> str:
        return f"lobby.lease = {self._seconds!r}"
