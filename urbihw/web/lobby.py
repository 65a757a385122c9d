"""A connection to the lobby of a server with asyncio: questions with answers, and all other output.

It is a connection of the client library; here stand the gateway's limits, and its words for what fails.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from urbihw.client.aio_connection import AsyncConnection
from urbihw.client.core import Statement
from urbihw.client.credentials import Credentials
from urbihw.client.dialect import Native, sent
from urbihw.client.errors import ClientError, UrbiError
from urbihw.client.lines import Line, guarded
from urbihw.client.literals import string_literal
from urbihw.client.session import Question
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


class LobbyError(Exception):
    """The server answered with an error, or not at all.

    Attributes:
        code: "language" for an error of urbiscript, "gone" without an answer, "limit" when too much waits.
    """

    def __init__(self, text: str, code: str) -> None:
        super().__init__(text)
        self.code = code


class LobbyLink:
    """One connection.  ``await LobbyLink.open(...)`` makes it."""

    def __init__(self, where: Where, credentials: Credentials, heard: Callable[[Line], None]) -> None:
        """``heard`` gets each line that is no answer."""
        self._connection = AsyncConnection(
            where, credentials, CONNECT_TIMEOUT_S, False, lambda line, at: heard(line), asks_first=False,
            max_line=MAX_LINE_BYTES, on_lost=lambda: self._closed(str(self._connection.core.close_reason())),
        )  # fmt: skip
        self._closed: Callable[[str], None] = lambda reason: None
        self._questions = 0

    @classmethod
    async def open(
        cls, where: Where, credentials: Credentials, heard: Callable[[Line], None], closed: Callable[[str], None]
    ) -> LobbyLink:
        """Connect; ``closed`` gets the reason of the end of the connection.  Raises LobbyError."""
        link = cls(where, credentials, heard)
        try:
            await link._connection.open()
        except ClientError as error:
            raise LobbyError(str(error), "gone") from error
        link._closed = closed
        return link

    # ---------------------------------------------------------------- asking

    def send(self, text: str) -> None:
        """Send text.  Raises LobbyError when the connection has ended, or the server does not read."""
        self._check_sending()
        self._connection.send(sent(text))

    def _check_sending(self) -> None:
        transport = self._connection.transport
        if transport is None or transport.is_closing():
            raise LobbyError("the daemon is not connected", "gone")
        if transport.get_write_buffer_size() > MAX_UNSENT_BYTES:
            raise LobbyError("the daemon does not read: too much waits for it already", "limit")

    def begin(self, body: str, *, text: bool = False) -> asyncio.Future[Line]:
        """Run an expression in the background; the future gets the line with its value, or LobbyError.

        With ``text`` the value is a String that is sent as it is, without quotes.
        """
        def statement(dialect: Native, channel: str) -> str:
            asked = f'lobby.send({body}, "{channel}")' if text else f'Channel.new("{channel}") << {{ {body} }}'
            return sent(guarded(asked, channel)) + ",\n"

        return self._begin(statement)

    def _begin(self, statement: Statement) -> asyncio.Future[Line]:
        if self._questions >= MAX_QUESTIONS:
            raise LobbyError("too many questions wait for an answer", "limit")
        self._check_sending()
        future: asyncio.Future[Line] = asyncio.get_running_loop().create_future()
        end = self._connection.begin(statement, partial(_answer, future))
        self._questions += 1

        def forget(done: asyncio.Future[Line]) -> None:
            self._questions -= 1
            end()
            if not done.cancelled():
                done.exception()  # an answer that nothing awaits may be an error

        future.add_done_callback(forget)
        return future

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
        def statement(dialect: Native, channel: str) -> str:
            return f'lobby.answerSlot("{channel}", {sent(string_literal(path))}),\n'

        line = await self._wait(self._begin(statement), ANSWER_TIMEOUT_S)
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

    def pause(self) -> None:
        """Read no more, until ``resume``: the server bounds what it keeps."""
        if self._connection.transport is not None:
            self._connection.transport.pause_reading()

    def resume(self) -> None:
        """Read the output of the server again."""
        if self._connection.transport is not None:
            self._connection.transport.resume_reading()

    def close(self) -> None:
        """End the connection, with what it moves.  ``closed`` is not called any more; a second call does nothing."""
        self._closed = lambda reason: None
        self._connection.close()


def _answer(future: asyncio.Future[Line], question: Question) -> None:
    """Hand on the answer to a question, or why there is none."""
    if future.done():
        return
    try:
        future.set_result(question.result())
    except UrbiError as error:
        future.set_exception(LobbyError(str(error), "language"))
    except ClientError as error:
        future.set_exception(LobbyError(f"the daemon is gone: {error}", "gone"))


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
