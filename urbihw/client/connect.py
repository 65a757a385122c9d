"""Connecting to a server, for programs that wait."""

from __future__ import annotations

import socket
import time
from typing import Final, Protocol

from urbihw.client.credentials import Credentials
from urbihw.client.entrance import LONGEST, Answer, question
from urbihw.client.where import Where

PROMPT: Final = 3.0
"""Seconds after which an answer to a question counts as one of a person; the server waits for ten."""

class Wire(Protocol):
    """A connection, as sockets have it.  One thread may send while another one receives."""

    def settimeout(self, seconds: float | None, /) -> None:
        """How long the others may take; then they raise TimeoutError."""

    def sendall(self, data: bytes, /) -> None:
        """Send."""

    def recv(self, size: int, /) -> bytes:
        """What has come, ``b""`` at the end."""

    def close(self) -> None:
        """Hang up."""


def connect(where: Where, credentials: Credentials, patience: float) -> Wire:
    """A connection, made within so many seconds.  Raises OSError, UnicodeError (a host that cannot be) or Denied.

    The user may be asked whether to trust the server, and for a token.
    """
    if where.path is not None:
        return _local(str(where.path), patience)
    return _secured(where, credentials, patience) if where.tls else _plain(where, patience)


def _local(path: str, patience: float) -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        made.settimeout(patience)
        made.connect(path)
    except OSError:
        made.close()
        raise
    return made


def _plain(where: Where, patience: float) -> socket.socket:
    made = socket.create_connection((where.host, where.port), patience)
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return made


def _secured(where: Where, credentials: Credentials, patience: float) -> Wire:
    from urbihw.client.secure import Secure  # TLS takes long to import, and most connections have none.

    while True:
        plain = _plain(where, patience)
        try:
            secure = Secure(where, plain)
            began = time.monotonic()
            credentials.judge(where, secure.certificate)
            first = question(where, credentials)
            if time.monotonic() - began > PROMPT:
                # Somebody was asked, and the server does not wait for that long.  The answers are known now.
                plain.close()
                continue
            secure.sendall(first)
            answer, rest = Answer(where, credentials), None
            while rest is None:
                rest = answer.feed(secure.recv(LONGEST))
        except BaseException:
            plain.close()
            raise
        secure.unread = rest
        return secure
