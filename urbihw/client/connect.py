"""Connects to a server with blocking sockets."""

from __future__ import annotations

import socket
import time
from typing import Final, Protocol

from urbihw.client.credentials import Credentials
from urbihw.client.login import MAX_REPLY_BYTES, LoginReply, login_line
from urbihw.client.where import Where

PROMPT_TIMEOUT_S: Final = 3.0
"""Maximum seconds for a login on the same connection.  If the user is asked for longer than this, the login uses a new
connection, since the server waits for ten seconds only."""

class ClientSocket(Protocol):
    """The methods of a socket that clients use.  One thread may send while another one receives."""

    def settimeout(self, seconds: float | None, /) -> None:
        """Set the timeout of the other methods, which then raise TimeoutError."""

    def sendall(self, data: bytes, /) -> None:
        """Send all of some bytes."""

    def recv(self, size: int, /) -> bytes:
        """Receive at most ``size`` bytes; ``b""`` at the end of the connection."""

    def shutdown(self, how: int, /) -> None:
        """End the connection: who waits for bytes gets its end."""

    def fileno(self) -> int:
        """The descriptor, to wait for bytes."""

    def close(self) -> None:
        """Close the connection to the server."""


def has_unread(made: ClientSocket) -> bool:
    """Whether ``recv`` would return at once, although the descriptor may have nothing to read (TLS)."""
    found = getattr(made, "has_unread", None)
    return found is not None and bool(found())


def connect(where: Where, credentials: Credentials, timeout: float) -> ClientSocket:
    """Connect within ``timeout`` seconds.  Raises OSError, UnicodeError (an impossible host name) or Denied.

    The user may be asked whether to trust the server, and for a token; that time does not count.
    """
    if where.path is not None:
        return _local(str(where.path), timeout)
    return _secured(where, credentials, timeout) if where.tls else _plain(where, timeout)


def _local(path: str, timeout: float) -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        made.settimeout(timeout)
        made.connect(path)
    except OSError:
        made.close()
        raise
    return made


def _plain(where: Where, timeout: float) -> socket.socket:
    made = socket.create_connection((where.host, where.port), timeout)
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return made


def _secured(where: Where, credentials: Credentials, timeout: float) -> ClientSocket:
    from urbihw.client.secure import TlsSocket  # TLS takes long to import, and most connections have none.

    while True:
        plain = _plain(where, timeout)
        try:
            secure = TlsSocket(where, plain, credentials.words)
            began = time.monotonic()
            credentials.check_certificate(where, secure.certificate)
            first = login_line(where, credentials)
            if time.monotonic() - began > PROMPT_TIMEOUT_S:
                # The user was asked, and the server does not wait for so long.  The answers are known now.
                plain.close()
                continue
            secure.sendall(first)
            answer, rest = LoginReply(where, credentials), None
            while rest is None:
                rest = answer.feed(secure.recv(MAX_REPLY_BYTES))
        except BaseException:
            plain.close()
            raise
        secure.unread = rest
        return secure
