"""The login of a TLS connection: the client sends ``token TOKEN``, and the server answers with one line.

Bytes in, bytes out; the server's side is ``urbihw.daemon.access``.
"""

from __future__ import annotations

from typing import Final

from urbihw.client.credentials import OPTIONS, Credentials, Denied, Words
from urbihw.client.where import Where

NOTICE: Final = b"*** urbihw: "
"""The beginning of the server's lines about the login."""
ACCEPTED: Final = NOTICE + b"token accepted"
REFUSED: Final = NOTICE + b"token refused"
WANTS_TLS: Final = NOTICE + b"this port speaks TLS"
"""The server's answer to a client that does not use TLS."""
_MAX_QUOTED: Final = 60
"""Maximum number of bytes quoted from another program's answer."""
MAX_REPLY_BYTES: Final = 1024
"""Maximum length of the line that answers a token, in bytes."""


class LoginInterrupted(OSError):
    """The server closed the connection before the login; the message quotes it.  A later attempt may succeed."""

    def __init__(self, words: str) -> None:
        super().__init__(words)
        self.strerror = words


def login_line(where: Where, credentials: Credentials) -> bytes:
    """The line with the token.  Raises Denied when there is no token."""
    return b"token " + credentials.token(where).encode("ascii") + b"\n"


def explain_close(where: Where, last: bytes, stamped: bool, words: Words = OPTIONS) -> Exception | None:
    """The reason why a server closed a connection behind ``last``, its last line (b"" for none).

    ``stamped``: one of its lines had a time stamp, as those of urbiscript have; ``words``: how the user asks for TLS.
    Returns Denied if to try again would not help, LoginInterrupted if it may, and None for the end of an ordinary
    connection.
    """
    if last.startswith(WANTS_TLS):
        return Denied(f"{where} speaks TLS, and wants a token: {words.tls} (urbihw access add NAME on the robot makes "
                      "one)")
    if last.startswith(NOTICE):
        return LoginInterrupted(last.removeprefix(NOTICE).decode("utf-8", "replace"))
    if not last and not where.tls and where.path is None:
        return LoginInterrupted(f"it closed the connection without a word; if it speaks TLS: {words.tls}")
    if not last:
        return LoginInterrupted("it closed the connection")
    if stamped:
        return None
    quoted = last[:_MAX_QUOTED].decode("ascii", "backslashreplace").strip()
    said = f", it said: {quoted!r}" if quoted else ""
    return LoginInterrupted(f"it is no urbiscript server{said}; is this its port?")


class LoginReply:
    """Parses the server's answer to a token, up to the beginning of the lobby's output."""

    def __init__(self, where: Where, credentials: Credentials) -> None:
        self._where = where
        self._credentials = credentials
        self._heard = b""

    def feed(self, data: bytes) -> bytes | None:
        """None until the answer is complete; then the bytes behind it.

        An empty ``data`` is the end of the connection.  Raises Denied, or LoginInterrupted.
        """
        self._heard += data
        line, end, rest = self._heard.partition(b"\n")
        if not end and data and len(line) < MAX_REPLY_BYTES:
            return None
        if line.startswith(ACCEPTED) and end:
            return rest
        words = line[:MAX_REPLY_BYTES].removeprefix(NOTICE).decode("utf-8", "replace").strip()
        if line.startswith(REFUSED):
            self._credentials.forget_token(self._where)
            raise Denied(f"{self._where}: {words}")
        raise LoginInterrupted(words or "it closed the connection")
