"""A connection to the lobby of a server with asyncio: questions with answers, and all other output.

Each question has a channel of its own, so that answers may come in any order, and differ from other output.
"""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import Callable
from typing import Any, Final

from urbihw.client.credentials import Credentials, Denied
from urbihw.client.dial import dial
from urbihw.client.lines import BadLine, Line, Lines, guarded
from urbihw.client.literals import string_literal
from urbihw.client.login import explain_close
from urbihw.client.values import NotAValue, value_of
from urbihw.client.where import Where

CONNECT_TIMEOUT_S: Final = 5.0
ANSWER_TIMEOUT_S: Final = 3.0
MAX_LINE_BYTES: Final = 16 * 1024 * 1024
"""Maximum length of a line of the server, of a picture for instance."""
MAX_UNSENT_BYTES: Final = 1024 * 1024
"""Bytes that may wait because the server does not read; more are refused."""
MAX_QUESTIONS: Final = 256
"""Questions that may wait for an answer."""
_ANSWER: Final = "__urbihw_web_"


class LobbyError(Exception):
    """The server answered with an error, or not at all.

    Attributes:
        code: "language" for an error of urbiscript, "gone" without an answer, "limit" when too much waits.
    """

    def __init__(self, text: str, code: str) -> None:
        super().__init__(text)
        self.code = code


class LobbyLink(asyncio.Protocol):
    """One connection.  ``await LobbyLink.open(...)`` makes it."""

    def __init__(self, where: Where, heard: Callable[[Line], None], closed: Callable[[str], None]) -> None:
        """``heard`` gets each line that is no answer, ``closed`` the reason of the end of the connection."""
        self._where = where
        self._heard = heard
        self._closed = closed
        self._lines = Lines(MAX_LINE_BYTES)
        self._numbers = itertools.count(1)
        self._waiting: dict[str, asyncio.Future[Line]] = {}
        self._transport: asyncio.Transport | None = None
        self._reason = ""
        self._is_closed = False

    @classmethod
    async def open(
        cls, where: Where, credentials: Credentials, heard: Callable[[Line], None], closed: Callable[[str], None]
    ) -> LobbyLink:
        """Connect.  Raises LobbyError."""
        link = cls(where, heard, closed)
        try:
            # Not wait_for, which loses a cancellation that comes with the result (Python 3.11).
            async with asyncio.timeout(CONNECT_TIMEOUT_S):
                await dial(where, credentials, lambda: link)
        except BaseException as error:
            link.close()  # who is cancelled may be connected already
            if not isinstance(error, OSError | TimeoutError | UnicodeError | Denied):
                raise
            raise LobbyError(f"no connection to {where}: {_reason_of(error)}", "gone") from error
        return link

    # ---------------------------------------------------------------- asking

    def send(self, text: str) -> None:
        """Send text.  Raises LobbyError when the connection has ended, or the server does not read."""
        transport = self._transport
        if transport is None or transport.is_closing():
            raise LobbyError("the daemon is not connected", "gone")
        if transport.get_write_buffer_size() > MAX_UNSENT_BYTES:
            raise LobbyError("the daemon does not read: too much waits for it already", "limit")
        transport.write(text.encode("utf-8", "surrogateescape"))

    def begin(self, body: str, *, text: bool = False) -> asyncio.Future[Line]:
        """Run an expression in the background; the future gets the line with its value, or LobbyError.

        With ``text`` the value is a String that is sent as it is, without quotes.
        """
        def statement(channel: str) -> str:
            asked = f'lobby.send({body}, "{channel}")' if text else f'Channel.new("{channel}") << {{ {body} }}'
            return guarded(asked, channel)

        return self._begin(statement)

    def _begin(self, statement: Callable[[str], str]) -> asyncio.Future[Line]:
        if len(self._waiting) >= MAX_QUESTIONS:
            raise LobbyError("too many questions wait for an answer", "limit")
        channel = f"{_ANSWER}{next(self._numbers)}"
        future: asyncio.Future[Line] = asyncio.get_running_loop().create_future()
        self.send(statement(channel) + ",\n")
        self._waiting[channel] = future
        future.add_done_callback(lambda done: self._forget(channel, done))
        return future

    def _forget(self, channel: str, done: asyncio.Future[Line]) -> None:
        self._waiting.pop(channel, None)
        if not done.cancelled():
            done.exception()  # an answer that is not awaited may be an error

    async def ask(self, body: str, timeout: float = ANSWER_TIMEOUT_S, *, text: bool = False) -> Line:
        """The line with the value of an expression.  Raises LobbyError."""
        return await self._wait(self.begin(body, text=text), timeout)

    async def _wait(self, answer: asyncio.Future[Line], timeout: float) -> Line:
        try:
            async with asyncio.timeout(timeout):
                return await answer
        except TimeoutError:
            text = f"the daemon has not answered for {timeout:g} s: is a program holding it?"
            raise LobbyError(text, "gone") from None

    async def read(self, path: str) -> Any:
        """The value of a slot; no function is called.  Raises LobbyError."""
        line = await self._wait(self._begin(lambda channel: f'lobby.answerSlot("{channel}", {string_literal(path)})'),
                                ANSWER_TIMEOUT_S)
        kind, *told = plain_value(line)
        if kind == "function":
            raise LobbyError(f"{path} is a function: call it", "language")
        if kind == "error":
            raise LobbyError(str(told[1][0]), "language")
        return told[0]

    async def value(self, body: str, timeout: float = ANSWER_TIMEOUT_S) -> Any:
        """The value of an expression as Python's own.  Raises LobbyError."""
        return plain_value(await self.ask(body, timeout))

    async def json(self, body: str, timeout: float = ANSWER_TIMEOUT_S) -> Any:
        """What the JSON text tells that an expression makes.  Raises LobbyError."""
        line = await self.ask(body, timeout, text=True)
        try:
            return json.loads(line.text)
        except ValueError as error:
            raise LobbyError(f"the daemon sent no JSON: {line.shown[:80]}", "gone") from error

    # ---------------------------------------------------------------- flow

    def pause(self) -> None:
        """Read no more, until ``resume``: the server bounds what it keeps."""
        if self._transport is not None and not self._transport.is_closing():
            self._transport.pause_reading()

    def resume(self) -> None:
        """Read again."""
        if self._transport is not None and not self._transport.is_closing():
            self._transport.resume_reading()

    def close(self) -> None:
        """End the connection, with what it moves.  ``closed`` is not called any more; a second call does nothing."""
        self._closed, self._is_closed = lambda reason: None, True
        if self._transport is not None:
            self._transport.abort()

    # ---------------------------------------------------------------- of asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The connection is open."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        if self._is_closed:
            transport.abort()

    def data_received(self, data: bytes) -> None:
        """Pass on the lines that are complete."""
        try:
            lines = self._lines.feed(data)
        except BadLine as error:
            self._reason = str(error)
            if self._transport is not None:
                self._transport.abort()
            return
        for line in lines:
            waiting = self._waiting.get(line.channel) if line.channel.startswith(_ANSWER) else None
            if waiting is None:
                if not line.channel.startswith(_ANSWER):  # else an answer that is no longer awaited
                    self._heard(line)
            elif line.stamp is not None and not waiting.done():
                if line.is_error:
                    waiting.set_exception(LobbyError(line.shown.removeprefix("!!! "), "language"))
                else:
                    waiting.set_result(line)

    def connection_lost(self, error: Exception | None) -> None:
        """The connection has ended."""
        why = explain_close(self._where, self._lines.last, self._lines.stamped) or error
        reason = self._reason or (_reason_of(why) if why else "it closed the connection")
        for future in list(self._waiting.values()):
            if not future.done():
                future.set_exception(LobbyError(f"the daemon is gone: {reason}", "gone"))
        self._transport = None
        self._closed(reason)


def plain_value(line: Line) -> Any:
    """The value in a line as a value of JSON: the printed name of an object, keywords and size of a Binary."""
    try:
        return utf8(value_of(line, binary=lambda found: {"keywords": found.keywords, "bytes": len(found.data)}))
    except NotAValue:
        return line.shown


def utf8(value: Any) -> Any:
    """A value with its strings decoded: those of the server have one character for each byte."""
    if isinstance(value, str):
        return value.encode("latin-1", "replace").decode("utf-8", "replace")
    if isinstance(value, list):
        return [utf8(each) for each in value]
    if isinstance(value, dict):
        return {utf8(key): utf8(each) for key, each in value.items()}
    return value


def _reason_of(error: Exception) -> str:
    if isinstance(error, TimeoutError):
        return "no answer"
    return getattr(error, "strerror", None) or str(error)
