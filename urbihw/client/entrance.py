"""The first words of a connection by TLS: ``token TOKEN``, and the line by which the server lets us in or does not.

Bytes in, bytes out; the server's side of it is ``urbihw.daemon.access``.
"""

from __future__ import annotations

from typing import Final

from urbihw.client.credentials import Credentials, Denied
from urbihw.client.where import Where

NOTICE: Final = b"*** urbihw: "
"""What the server's own words begin with when it does not let somebody in."""
ACCEPTED: Final = NOTICE + b"token accepted"
REFUSED: Final = NOTICE + b"token refused"
WANTS_TLS: Final = NOTICE + b"this port speaks TLS"
"""What a client reads that has not spoken TLS."""
_SHOWN: Final = 60
"""Bytes that are quoted of what another program said."""
LONGEST: Final = 1024
"""Bytes of the line that answers a token."""


class Turned(OSError):
    """The server ended the connection before it let us in, with these words; it may let us in later."""

    def __init__(self, words: str) -> None:
        super().__init__(words)
        self.strerror = words


def question(where: Where, credentials: Credentials) -> bytes:
    """What to say first.  Raises Denied when there is no token."""
    return b"token " + credentials.token(where).encode("ascii") + b"\n"


def turned_away(where: Where, last: bytes, known: bool) -> Exception | None:
    """What it means that a server ended a connection behind this last line, b"" if it said nothing.

    ``known``: something of what it said was urbiscript's.  Denied where trying again would not help, Turned where it
    may; None for the end of an ordinary conversation.
    """
    if last.startswith(WANTS_TLS):
        return Denied(f"{where} speaks TLS, and wants a token: --tls (urbihw access add NAME on the robot makes one)")
    if last.startswith(NOTICE):
        return Turned(last.removeprefix(NOTICE).decode("utf-8", "replace"))
    if not last and not where.tls and where.path is None:
        return Turned("it closed the connection without a word; if it speaks TLS: --tls")
    if not last:
        return Turned("it closed the connection")
    if known:
        return None
    words = last[:_SHOWN].decode("ascii", "backslashreplace").strip()
    return Turned(f"it is no urbiscript server, it said: {words!r}; is this its port?")


class Answer:
    """What a server says to a token: bytes in; cut off where the connection proper begins."""

    def __init__(self, where: Where, credentials: Credentials) -> None:
        self._where = where
        self._credentials = credentials
        self._heard = b""

    def feed(self, data: bytes) -> bytes | None:
        """None until the answer is there; then what came behind it.

        An empty ``data`` is the end of the connection.  Raises Denied, or Turned.
        """
        self._heard += data
        line, end, rest = self._heard.partition(b"\n")
        if not end and data and len(line) < LONGEST:
            return None
        if line.startswith(ACCEPTED) and end:
            return rest
        words = line[:LONGEST].removeprefix(NOTICE).decode("utf-8", "replace").strip()
        if line.startswith(REFUSED):
            self._credentials.forget(self._where)
            raise Denied(f"{self._where}: {words}")
        raise Turned(words or "it closed the connection")
