"""The connection of the console, with automatic reconnection."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final, Literal

from urbihw.backoff import BackOff
from urbihw.client.aio_connection import AsyncConnection
from urbihw.client.credentials import Credentials, Denied
from urbihw.client.dialect import sent
from urbihw.client.errors import AccessDenied, CannotConnect
from urbihw.client.lines import Line
from urbihw.client.login import NOTICE, explain_close
from urbihw.client.session import Question
from urbihw.client.where import Where, why

CONNECT_TIMEOUT_S: Final = 5.0
FIRST_PAUSE_S: Final = 0.25
MAX_PAUSE_S: Final = 2.0
"""Seconds before the first attempt to reconnect, and the maximum of the doubled pauses."""
FIRST_WORD_TIMEOUT_S: Final = 0.5
"""Seconds after which a silent server counts as busy, not as one that refuses the connection."""

State = Literal["connecting", "connected", "lost", "denied"]


class ConsoleSession:
    """The connection to one server, while the console runs or until the server refuses the credentials ("denied").

    ``heard`` is called with each line.  ``changed`` is called when ``state`` has changed; ``reason`` is
    then the reason why there is no connection.
    """

    def __init__(
        self,
        where: Where,
        who: Credentials,
        heard: Callable[[Line], None],
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
        self._link: AsyncConnection | None = None

    @property
    def name(self) -> str:
        """The name of the server, for display."""
        return str(self.where)

    async def run(self) -> None:
        """Connect, receive, reconnect; for ever, unless denied."""
        pauses = BackOff(FIRST_PAUSE_S, MAX_PAUSE_S)
        while True:
            try:
                if await self._converse():
                    pauses.reset()
            except CannotConnect as error:
                self.reason = error.reason
            except AccessDenied as error:
                self.reason = str(error)
                self._enter("denied")
                return
            self._enter("lost")
            await asyncio.sleep(pauses.next_pause())

    async def _converse(self) -> bool:
        """Connect, and receive until the connection ends; returns whether there was one, not only a refusal.

        A server that is silent for a while is busy; one that refuses does so at once, and then there was no connection.
        Raises CannotConnect or AccessDenied.
        """
        ended = asyncio.Event()
        link = AsyncConnection(self.where, self._who, CONNECT_TIMEOUT_S, False, self._hear, asks_first=False,
                               on_lost=ended.set)
        await link.open()
        self._link = link
        try:
            # Between push and pop, the text leaves no trace in the positions of later errors.
            question = '//#push 1 "console"\nChannel.new("%s") << lobby.uid|;\n//#pop\n'
            link.begin(lambda dialect, channel: question % channel, self._take_uid)
            busy = asyncio.get_running_loop().call_later(FIRST_WORD_TIMEOUT_S, self._enter, "connected")
            await ended.wait()
            busy.cancel()
        finally:
            self._link = None
            self.uid = ""
            link.close()
        lines = link.core.session.lines
        turned = explain_close(self.where, lines.last, lines.stamped)
        if isinstance(turned, Denied):
            raise AccessDenied(str(turned))
        self.reason = link.core.fault or (why(turned) if turned is not None else "the server closed the connection")
        return turned is None

    def _hear(self, line: Line, at: float) -> None:
        if not line.raw.startswith(NOTICE):
            self._enter("connected")
        self._heard(line)

    def _take_uid(self, question: Question) -> None:
        if question.error is None:
            self._enter("connected")
            self.uid = question.value.shown.strip('"')

    def _enter(self, state: State) -> None:
        if state != self.state:
            self.state = state
            self._changed()

    def send(self, text: str) -> bool:
        """Send text; False without a connection."""
        if self._link is None or self.state != "connected":
            return False
        self._link.send(sent(text))
        return True
