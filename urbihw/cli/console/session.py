"""The connection of the console, with automatic reconnection."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import Final, Literal

from urbihw.backoff import BackOff
from urbihw.client.credentials import Credentials, Denied
from urbihw.client.dial import open_streams
from urbihw.client.lines import BadLine, Line, Lines
from urbihw.client.login import NOTICE, explain_close
from urbihw.client.where import Where, why

CHUNK: Final = 256 * 1024
CONNECT_TIMEOUT_S: Final = 5.0
FIRST_PAUSE_S: Final = 0.25
MAX_PAUSE_S: Final = 2.0
"""Seconds before the first attempt to reconnect, and the maximum of the doubled pauses."""
FIRST_WORD_TIMEOUT_S: Final = 0.5
"""Seconds after which a silent server counts as busy, not as one that refuses the connection."""
CHANNEL: Final = "__urbihw_console"
"""The channel for the uid of the lobby; its lines are not shown."""

State = Literal["connecting", "connected", "lost", "denied"]


class ConsoleSession:
    """The connection to one server, while the console runs or until the server refuses the credentials ("denied").

    ``heard`` is called with the lines of each packet.  ``changed`` is called when ``state`` has changed; ``reason`` is
    then the reason why there is no connection.
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
        """The ``uid`` of the console's lobby, for the assistant; empty while it is not known."""
        self._heard = heard
        self._changed = changed
        self._writer: asyncio.StreamWriter | None = None

    @property
    def name(self) -> str:
        """The name of the server, for display."""
        return str(self.where)

    async def run(self) -> None:
        """Connect, receive, reconnect; for ever, unless denied."""
        pauses = BackOff(FIRST_PAUSE_S, MAX_PAUSE_S)
        while True:
            try:
                reader, writer = await asyncio.wait_for(open_streams(self.where, self._who), CONNECT_TIMEOUT_S)
            except Denied as error:
                self.reason = str(error)
                self._enter("denied")
                return
            except (OSError, TimeoutError, UnicodeError) as error:
                self.reason = why(error)
                self._enter("lost")
                await asyncio.sleep(pauses.next_pause())
                continue
            self._writer = writer
            turned = await self._converse(reader, writer)
            self._writer = None
            self.uid = ""
            if isinstance(turned, Denied):
                self.reason = str(turned)
                self._enter("denied")
                return
            if turned is None:
                pauses.reset()
            self._enter("lost")
            await asyncio.sleep(pauses.next_pause())

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> Exception | None:
        """Receive until the connection ends.  Returns the reason if the server has refused the connection.

        A server that is silent for a while is busy; one that refuses does so at once, and then there was no connection.
        """
        # Between push and pop, the text leaves no trace in the positions of later errors.
        writer.write(f'//#push 1 "console"\nChannel.new("{CHANNEL}") << lobby.uid|;\n//#pop\n'.encode())
        self.reason = "the server closed the connection"
        lines = Lines()
        try:
            data = await self._first(reader)
            if data is None or data and not data.startswith(NOTICE):
                self._enter("connected")
            while data := await reader.read(CHUNK) if data is None else data:
                self._pass_on(lines.feed(data))
                data = None
        except OSError as error:
            self.reason = why(error)
        except BadLine as error:
            self.reason = str(error)
        writer.close()
        with contextlib.suppress(OSError):
            await writer.wait_closed()
        turned = explain_close(self.where, lines.last, lines.stamped)
        if turned is not None:
            self.reason = why(turned)
        return turned

    @staticmethod
    async def _first(reader: asyncio.StreamReader) -> bytes | None:
        """The first bytes of the server, b"" at the end of the connection; None if it is silent for a while."""
        try:
            return await asyncio.wait_for(reader.read(CHUNK), FIRST_WORD_TIMEOUT_S)
        except TimeoutError:
            return None

    def _pass_on(self, lines: list[Line]) -> None:
        """Pass on all lines except the answer with the uid."""
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
        """Send text; False without a connection."""
        if self._writer is None or self.state != "connected":
            return False
        self._writer.write(text.encode("utf-8", "surrogateescape"))
        return True
