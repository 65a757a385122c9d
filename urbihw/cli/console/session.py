"""The connection of the console: it comes back by itself when it was lost."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import Final, Literal

from urbihw.cli.lines import BadLine, Line, Lines
from urbihw.cli.options import why
from urbihw.client.credentials import Credentials, Denied
from urbihw.client.dial import streams
from urbihw.client.entrance import NOTICE, turned_away
from urbihw.client.where import Where

CHUNK: Final = 256 * 1024
PATIENCE: Final = 5.0
FIRST_PAUSE: Final = 0.25
LONGEST_PAUSE: Final = 2.0
BUSY: Final = 0.5
"""Seconds after which a server that says nothing counts as a busy one, and not as one that turns us away."""
CHANNEL: Final = "__urbihw_console"
"""On which the server tells who we are; nothing of it is shown."""

State = Literal["connecting", "connected", "lost", "denied"]


class Session:
    """One server, for as long as the console runs, or until it does not let us in any more ("denied").

    ``heard`` gets the lines of each packet.  ``changed`` is called when ``state`` is another one; ``reason`` then says
    why there is no connection.
    """

    def __init__(
        self,
        where: Where,
        who: Credentials,
        heard: Callable[[list[Line]], None],
        changed: Callable[[], None],
    ) -> None:
        self.where = where
        self._who = who
        self.state: State = "connecting"
        self.reason = ""
        self.uid = ""
        """The ``uid`` of our lobby, by which the assistant finds it; empty while it is not known."""
        self._heard = heard
        self._changed = changed
        self._writer: asyncio.StreamWriter | None = None

    @property
    def name(self) -> str:
        """The server, for people."""
        return str(self.where)

    async def run(self) -> None:
        """Connect, listen, connect again; for ever, unless denied."""
        pause = FIRST_PAUSE
        while True:
            try:
                reader, writer = await asyncio.wait_for(streams(self.where, self._who), PATIENCE)
            except Denied as error:
                self.reason = str(error)
                self._enter("denied")
                return
            except (OSError, TimeoutError, UnicodeError) as error:
                self.reason = why(error)
                self._enter("lost")
                await asyncio.sleep(pause)
                pause = min(pause * 2, LONGEST_PAUSE)
                continue
            self._writer = writer
            turned = await self._converse(reader, writer)
            self._writer = None
            self.uid = ""
            if isinstance(turned, Denied):
                self.reason = str(turned)
                self._enter("denied")
                return
            pause = FIRST_PAUSE if turned is None else min(pause * 2, LONGEST_PAUSE)
            self._enter("lost")
            await asyncio.sleep(pause)

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> Exception | None:
        """Until the connection ends; why, if the server has turned us away.

        A server that says nothing for a while is busy; one that turns us away does so at once, and then there was no
        connection.
        """
        # Between push and pop it leaves no trace in the positions of later errors.
        writer.write(f'//#push 1 "console"\nChannel.new("{CHANNEL}") << lobby.uid|;\n//#pop\n'.encode())
        self.reason = "the server closed the connection"
        lines, last, known = Lines(), b"", False
        try:
            data = await self._first(reader)
            if data is None or data and not data.startswith(NOTICE):
                self._enter("connected")
            while data := await reader.read(CHUNK) if data is None else data:
                fresh = lines.feed(data)
                last = fresh[-1].text if fresh else last
                known = known or any(line.stamp is not None for line in fresh)
                self._take(fresh)
                data = None
        except OSError as error:
            self.reason = why(error)
        except BadLine as error:
            self.reason = str(error)
        writer.close()
        with contextlib.suppress(OSError):
            await writer.wait_closed()
        turned = turned_away(self.where, last, known)
        if turned is not None:
            self.reason = why(turned)
        return turned

    @staticmethod
    async def _first(reader: asyncio.StreamReader) -> bytes | None:
        """What the server says first, b"" at the end of the connection; None if it says nothing for a while."""
        try:
            return await asyncio.wait_for(reader.read(CHUNK), BUSY)
        except TimeoutError:
            return None

    def _take(self, lines: list[Line]) -> None:
        for line in lines:
            if line.channel == CHANNEL:
                self.uid = line.shown.strip('"')
        shown = [line for line in lines if line.channel != CHANNEL]
        if shown:
            self._heard(shown)

    def _enter(self, state: State) -> None:
        if state != self.state:
            self.state = state
            self._changed()

    def send(self, text: str) -> bool:
        """Say something; False when there is nobody to hear it."""
        if self._writer is None or self.state != "connected":
            return False
        self._writer.write(text.encode("utf-8", "surrogateescape"))
        return True
