"""A connection to a server, for programs that do one thing after the other.

What a program asks for itself is answered on a channel of its own (``ask``, ``follow``), so that it is told apart from
what else the server says on the connection: banner, ``wall``, errors of others.  One question at a time: a question
that was not answered in time ends the matter.
"""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Iterator
from types import TracebackType
from typing import Final

from urbihw.cli.lines import BadLine, Line, Lines, guarded
from urbihw.cli.options import EX_UNAVAILABLE, Refused, why
from urbihw.client.connect import connect
from urbihw.client.credentials import Credentials, Denied
from urbihw.client.entrance import turned_away
from urbihw.client.where import Where

NO_SERVER: Final = 1
"""Exit code when nobody listens, as of the SDK's own clients (server protocol, section 9)."""
CONNECT_PATIENCE: Final = 10.0
CHUNK: Final = 256 * 1024


class Link:
    """``with Link(where, credentials) as link``: connected.  Raises Refused when that cannot be."""

    def __init__(self, where: Where, credentials: Credentials) -> None:
        self.peer = str(where)
        self._where = where
        try:
            self._socket = connect(where, credentials, CONNECT_PATIENCE)
        except (OSError, UnicodeError) as error:
            raise Refused(_no_server(where, error), NO_SERVER) from error
        except Denied as error:
            raise Refused(str(error), EX_UNAVAILABLE) from error
        self._lines = Lines()
        self._waiting: deque[Line] = deque()
        self._channel = f"__urbihw_{os.getpid()}"
        self._last = b""
        """The last line that was heard."""
        self._known = False
        """Whether something was urbiscript's, which has a time stamp."""
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
                lines = self._lines.feed(data)
            except BadLine as error:
                raise Refused(f"{self.peer}: {error}; is that an urbiscript server?") from error
            if lines:
                self._waiting += lines
                self._last = lines[-1].text
                self._known = self._known or any(line.stamp is not None for line in lines)
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
        if line is None and self.ended:
            raise self._hung_up()
        if line is None and not lines:
            raise Refused(f"{self.peer} said nothing within {patience:g} s: is it busy, is it an urbiscript server?")
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
            raise self._hung_up()
        raise Refused(f"{self.peer} {silence}")

    def _hung_up(self) -> Refused:
        """What to say when the server has ended the connection: its reason, if it gave one."""
        reason = turned_away(self._where, self._last, self._known)
        if isinstance(reason, Denied):
            return Refused(str(reason))
        return Refused(f"{self.peer}: {reason or 'it closed the connection'}")

    def close(self) -> None:
        """Hang up."""
        self._socket.close()

    def __enter__(self) -> Link:
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
