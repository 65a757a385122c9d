"""The first words of a connection by TLS: ``token TOKEN``, and the line by which the server lets us in or does not.

Bytes in, bytes out; the server's side of it is ``urbihw.daemon.access``.
"""

from __future__ import annotations

from typing import Final

from urbihw.client.credentials import Credentials, Denied
from urbihw.client.where import Where

ACCEPTED: Final = b"*** urbihw: token accepted"
REFUSED: Final = b"*** urbihw: token refused"
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
        words = line[:LONGEST].decode("utf-8", "replace").strip().removeprefix("*** urbihw: ")
        if line.startswith(REFUSED):
            self._credentials.forget(self._where)
            raise Denied(f"{self._where}: {words}")
        raise Turned(words or "it closed the connection")
