"""A connection to a server, for programs that do one thing after the other.

What a program asks for itself is answered on a channel of its own (``ask``, ``follow``), so that it is told apart from
what else the server says on the connection: banner, ``wall``, errors of others.  One question at a time: a question
that was not answered in time ends the matter.
"""

from __future__ import annotations

import os
import socket
import time
from collections import deque
from collections.abc import Iterator
from types import TracebackType
from typing import Final

from urbihw.cli.lines import BadLine, Line, Lines, guarded
from urbihw.cli.options import EX_UNAVAILABLE, Refused, why

NO_SERVER: Final = 1
"""Exit code when nobody listens, as of the SDK's own clients (server protocol, section 9)."""
CONNECT_PATIENCE: Final = 10.0
CHUNK: Final = 256 * 1024


class Link:
    """``with Link(host, port) as link``: connected.  Raises Refused when that cannot be."""

    def __init__(self, host: str, port: int) -> None:
        self.peer = f"{host}:{port}"
        try:
            self._socket = socket.create_connection((host, port), CONNECT_PATIENCE)
        except (OSError, UnicodeError) as error:
            raise Refused(f"cannot connect to {self.peer}: {why(error)}; is the server running, is this its port?",
                          NO_SERVER) from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._lines = Lines()
        self._waiting: deque[Line] = deque()
        self._channel = f"__urbihw_{os.getpid()}"
        self.ended = False

    def send(self, text: bytes) -> None:
        """Say something.  A server that is gone is noticed by who reads."""
        try:
            self._socket.settimeout(CONNECT_PATIENCE)
            self._socket.sendall(text)
        except (BrokenPipeError, ConnectionError):
            pass
        except TimeoutError:
            raise Refused(f"{self.peer} does not read what it is sent", EX_UNAVAILABLE) from None

    def read(self, patience: float | None = None) -> Line | None:
        """The next line; None when the connection has ended (``ended``) or none came within so many seconds."""
        limit = None if patience is None else time.monotonic() + patience
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
            self._take(data)
        return self._waiting.popleft() if self._waiting else None

    def _take(self, data: bytes) -> None:
        if data:
            try:
                self._waiting += self._lines.feed(data)
            except BadLine as error:
                raise Refused(f"{self.peer}: {error}; is that an urbiscript server?") from error
            return
        self.ended = True
        if self._lines.rest:
            rest = self._lines.rest
            self._waiting.append(Line(rest, rest))

    def greeting(self, patience: float = 5.0) -> list[Line]:
        """What the server says to a new connection: banner, ``local.u``.

        Found by a question of which nothing is seen, not even in the positions of later errors.
        """
        self.send(f'//#push 1 "greeting"\nChannel.new("{self._channel}") << 1|;\n//#pop\n'.encode())
        lines = []
        limit = time.monotonic() + patience
        while (line := self.read(limit - time.monotonic())) is not None and line.channel != self._channel:
            lines.append(line)
        return lines

    def ask(self, expression: str, patience: float = 10.0) -> Line:
        """The value of an expression.  Raises Refused with the server's words when it has none."""
        self._run(f'Channel.new("{self._channel}") << {{ {expression} }}')
        return self._answer(patience, f"did not answer within {patience:g} s: is it busy, is it an urbiscript server?")

    def follow(self, statement: str, patience: float) -> Iterator[Line]:
        """What a statement writes to the Channel ``answers``, one by one.

        Raises Refused when it fails, and when nothing comes for so many seconds.
        """
        self._run(f'var answers = Channel.new("{self._channel}") | {statement}')
        while True:
            yield self._answer(patience, f"sent nothing for {patience:g} s; is the device switched on (load = 1)?")

    def _run(self, body: str) -> None:
        """Run code in the background, its error being an answer: it neither waits for nor disturbs what else runs."""
        self.send(guarded(body, self._channel).encode() + b",\n")

    def _answer(self, patience: float, silence: str) -> Line:
        limit = time.monotonic() + patience
        while (line := self.read(limit - time.monotonic())) is not None:
            if line.channel == self._channel and line.stamp is not None:
                if line.is_error:
                    raise Refused(f"{self.peer}: {line.shown.removeprefix('!!! ')}")
                return line
        if self.ended:
            raise Refused(f"{self.peer} closed the connection")
        raise Refused(f"{self.peer} {silence}")

    def close(self) -> None:
        """Hang up."""
        self._socket.close()

    def __enter__(self) -> Link:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
