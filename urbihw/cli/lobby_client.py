"""A blocking connection to the lobby of a server, for the command-line programs.

Answers to the program's own questions (``ask``, ``follow``) come on a separate channel, which distinguishes them from
other output on the connection: the banner, ``wall``, errors of other statements.  There is one question at a time;
after a time-out the connection cannot be used any more.
"""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Iterator
from types import TracebackType
from typing import Final

from urbihw.cli.options import Refused, why
from urbihw.client.connect import connect
from urbihw.client.credentials import Credentials, Denied
from urbihw.client.lines import BadLine, Line, Lines, guarded
from urbihw.client.login import explain_close
from urbihw.client.where import Where
from urbihw.exitcodes import EX_UNAVAILABLE, NO_SERVER

CONNECT_TIMEOUT_S: Final = 10.0
"""Seconds to connect, and for the server to accept data."""
ANSWER_TIMEOUT_S: Final = 10.0
BANNER_TIMEOUT_S: Final = 5.0
CHUNK: Final = 256 * 1024


class LobbyClient:
    """``with LobbyClient(where, credentials) as link``: connected.  Raises Refused when that cannot be."""

    def __init__(self, where: Where, credentials: Credentials) -> None:
        self.peer = str(where)
        self._where = where
        try:
            self._socket = connect(where, credentials, CONNECT_TIMEOUT_S)
        except (OSError, UnicodeError) as error:
            raise Refused(_no_server(where, error), NO_SERVER) from error
        except Denied as error:
            raise Refused(str(error), EX_UNAVAILABLE) from error
        self._lines = Lines()
        self._waiting: deque[Line] = deque()
        self._channel = f"__urbihw_{os.getpid()}"
        self.ended = False

    def send(self, text: bytes) -> None:
        """Send text.  The loss of the connection is reported by ``read``."""
        try:
            self._socket.settimeout(CONNECT_TIMEOUT_S)
            self._socket.sendall(text)
        except (BrokenPipeError, ConnectionError):
            pass
        except TimeoutError:
            raise Refused(f"{self.peer} does not read what it is sent", EX_UNAVAILABLE) from None

    def read(self, timeout: float | None = None) -> Line | None:
        """The next line; None when the connection has ended (``ended``) or none came within so many seconds."""
        limit = None if timeout is None else time.monotonic() + timeout
        while not self._waiting and not self.ended:
            left = None if limit is None else limit - time.monotonic()
            if left is not None and left <= 0:
                return None
            self._socket.settimeout(left)
            try:
                data = self._socket.recv(CHUNK)
            except TimeoutError:
                return None
            except ConnectionError:
                data = b""
            self._add(data)
        return self._waiting.popleft() if self._waiting else None

    def _add(self, data: bytes) -> None:
        """Store the lines that these bytes complete; b"" is the end of the connection."""
        if data:
            try:
                lines = self._lines.feed(data)
            except BadLine as error:
                raise Refused(f"{self.peer}: {error}; is that an urbiscript server?") from error
            self._waiting += lines
            return
        self.ended = True
        if self._lines.rest:
            rest = self._lines.rest
            self._waiting.append(Line(rest))

    def read_banner(self, timeout: float = BANNER_TIMEOUT_S) -> list[Line]:
        """The lines that the server sends to a new connection: the banner, output of ``local.u``.

        Their end is found by a question that leaves no trace, not even in the positions of later errors.
        """
        self.send(f'//#push 1 "read_banner"\nChannel.new("{self._channel}") << 1|;\n//#pop\n'.encode())
        lines = []
        limit = time.monotonic() + timeout
        while (line := self.read(limit - time.monotonic())) is not None and line.channel != self._channel:
            lines.append(line)
        if line is None and self.ended:
            raise self._close_reason()
        if line is None and not lines:
            raise Refused(f"{self.peer} said nothing within {timeout:g} s: is it busy, is it an urbiscript server?")
        return lines

    def ask(self, expression: str, timeout: float = ANSWER_TIMEOUT_S) -> Line:
        """The value of an expression.  Raises Refused with the server's message on an error."""
        self._run(f'Channel.new("{self._channel}") << {{ {expression} }}')
        return self._answer(timeout, f"did not answer within {timeout:g} s: is it busy, is it an urbiscript server?")

    def follow(self, statement: str, timeout: float) -> Iterator[Line]:
        """Yield the lines that a statement writes to the Channel ``answers``.

        Raises Refused when the statement fails, and when no line arrives within ``timeout`` seconds.
        """
        self._run(f'var answers = Channel.new("{self._channel}") | {statement}')
        while True:
            yield self._answer(timeout, f"sent nothing for {timeout:g} s; is the device switched on (load = 1)?")

    def _run(self, body: str) -> None:
        """Run code in the background, so that it neither waits for nor disturbs other jobs.  Its error is sent as an
        answer."""
        self.send(guarded(body, self._channel).encode() + b",\n")

    def _answer(self, timeout: float, silence: str) -> Line:
        limit = time.monotonic() + timeout
        while (line := self.read(limit - time.monotonic())) is not None:
            if line.channel == self._channel and line.stamp is not None:
                if line.is_error:
                    raise Refused(f"{self.peer}: {line.shown.removeprefix('!!! ')}")
                return line
        if self.ended:
            raise self._close_reason()
        raise Refused(f"{self.peer} {silence}")

    def _close_reason(self) -> Refused:
        """The error for a connection that the server has closed, with the server's reason if it gave one."""
        reason = explain_close(self._where, self._lines.last, self._lines.stamped)
        if isinstance(reason, Denied):
            return Refused(str(reason))
        return Refused(f"{self.peer}: {reason or 'it closed the connection'}")

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def __enter__(self) -> LobbyClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _no_server(where: Where, error: OSError | UnicodeError) -> str:
    if where.path is not None and isinstance(error, FileNotFoundError | ConnectionRefusedError):
        left = " any more, and the file may go" if where.path.exists() else ""
        return f"nobody listens at {where.path}{left}; start the server: urbihw serve"
    return f"cannot connect to {where}: {why(error)}; is the server running, is this its port?"
