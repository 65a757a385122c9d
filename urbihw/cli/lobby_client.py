"""A connection of the command-line programs to the lobby of a server, by the client library.

What the server says is handed out as it was received, and an answer as its line.  Nothing is asked first, so that a
program meets any server, and its own text has the same places in errors as on a bare connection.  There is one question
at a time, and no second connection: what fails is a CliRefused, in one line.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Final

from urbihw.cli.options import CliRefused
from urbihw.client.connection import Connection
from urbihw.client.credentials import Credentials, Denied
from urbihw.client.dialect import Native, sent
from urbihw.client.errors import AccessDenied, CannotConnect, ClientError, TimedOut, UrbiError
from urbihw.client.lines import Line, guarded
from urbihw.client.session import Message, message_of
from urbihw.client.streams import LineStream
from urbihw.client.where import Where
from urbihw.exitcodes import EX_UNAVAILABLE, NO_SERVER

CONNECT_TIMEOUT_S: Final = 10.0
"""Seconds to connect, and for the server to accept data."""
ANSWER_TIMEOUT_S: Final = 10.0
BANNER_TIMEOUT_S: Final = 5.0


class LobbyClient:
    """``with LobbyClient(where, credentials) as link``: connected.  Raises CliRefused when that cannot be.

    ``unreachable`` is its exit code then: 1 for the programs of Urbi (docs/programs.md).
    """

    def __init__(self, where: Where, credentials: Credentials, unreachable: int = NO_SERVER) -> None:
        self.peer = str(where)
        self._waiting: deque[Message] = deque()
        self._told_rest = False
        try:
            self._connection = Connection(
                where, credentials, CONNECT_TIMEOUT_S, False,
                lambda line, at: self._waiting.append(message_of(line, at)), asks_first=False,
            )
        except CannotConnect as error:
            raise CliRefused(str(error), unreachable) from error
        except AccessDenied as error:
            raise CliRefused(str(error), EX_UNAVAILABLE) from error

    @property
    def ended(self) -> bool:
        """Whether the connection has ended."""
        return not self._connection.connected

    def send(self, text: bytes) -> None:
        """Send text.  The loss of the connection is reported by ``read``."""
        try:
            self._connection.send(text.decode("latin-1"))
        except ClientError:
            raise CliRefused(f"{self.peer} does not read what it is sent", EX_UNAVAILABLE) from None

    def read(self, timeout: float | None = None) -> Message | None:
        """The next line; None when the connection has ended (``ended``) or none came within so many seconds."""
        self._connection.wait(lambda: bool(self._waiting), timeout)
        if self._waiting:
            return self._waiting.popleft()
        if self.ended and self._connection.core.fault:
            raise self._close_reason()
        if self.ended and not self._told_rest and (rest := self._connection.core.session.lines.rest):
            self._told_rest = True
            return message_of(Line(rest), time.time())
        return None

    def read_banner(self, timeout: float = BANNER_TIMEOUT_S) -> list[Message]:
        """The lines that the server sends to a new connection: the banner, output of ``local.u``.

        Their end is found by a question that leaves no trace, not even in the positions of later errors.
        """
        def question(dialect: Native, channel: str) -> str:
            return f'//#push 1 "read_banner"\nChannel.new("{channel}") << 1|;\n//#pop\n'

        try:
            self._connection.ask(question, timeout, raw=True)
        except TimedOut:
            if not self._waiting:
                silence = f"said nothing within {timeout:g} s: is it busy, is it an urbiscript server?"
                raise CliRefused(f"{self.peer} {silence}") from None
        except ClientError:
            raise self._close_reason() from None
        lines = list(self._waiting)
        self._waiting.clear()
        return lines

    def ask(
        self, expression: str, timeout: float = ANSWER_TIMEOUT_S, heard: Callable[[Message], None] = lambda line: None
    ) -> Line:
        """The value of an expression.  Raises CliRefused with the server's message on an error.

        ``heard`` gets the other lines that came before the answer.
        """
        def question(dialect: Native, channel: str) -> str:
            # In the background, so that it neither waits for nor disturbs other jobs.
            return guarded(f'Channel.new("{channel}") << {{ {sent(expression)} }}', channel) + ",\n"

        with self._refusing(f"did not answer within {timeout:g} s: is it busy, is it an urbiscript server?"):
            try:
                answer: Line = self._connection.ask(question, timeout, located=True, raw=True)
            finally:
                while self._waiting:
                    heard(self._waiting.popleft())
        return answer

    def follow(self, statement: str, timeout: float) -> Iterator[Line]:
        """Yield the lines that a statement writes to the Channel ``answers``.

        Raises CliRefused when the statement fails, and when no line arrives within ``timeout`` seconds.
        """
        stream = LineStream(sent(statement))
        silence = f"sent nothing for {timeout:g} s; is the device switched on (load = 1)?"
        try:
            with self._refusing(silence):
                self._connection.open_stream(stream)
            while True:
                with self._refusing(silence):
                    line: Line = self._connection.next_item(stream, timeout)
                self._waiting.clear()
                yield line
        finally:
            self._connection.forget_stream(stream)

    @contextmanager
    def _refusing(self, silence: str) -> Iterator[None]:
        """Turn errors of the library into CliRefused; ``silence`` is what is said of a server that says nothing."""
        try:
            yield
        except UrbiError as error:
            raise CliRefused(f"{self.peer}: {error}") from None
        except TimedOut:
            raise CliRefused(f"{self.peer} {silence}") from None
        except ClientError:
            raise self._close_reason() from None

    def _close_reason(self) -> CliRefused:
        """The error for a connection that the server has closed, with the server's reason if it gave one."""
        reason = self._connection.core.close_reason()
        return CliRefused(str(reason) if isinstance(reason, Denied) else f"{self.peer}: {reason}")

    def close(self) -> None:
        """Close the connection to the server."""
        self._connection.close()

    def __enter__(self) -> LobbyClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
