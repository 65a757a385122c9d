"""The first bytes of a connection: is it somebody who types urbiscript?

A web page can make the browser of somebody on this machine send bytes to 127.0.0.1, and what a browser sends in front
of them (``POST / HTTP/1.1``) would be skipped as a syntax error.  So a connection that begins as another protocol does
is closed before anything of it is evaluated.  A browser decides about the path and about what follows, but never about
the first bytes: they are a method and a blank, or the first record of TLS, STUN or SSH.

A ``Greeting`` decides.  It is made for each connection, and sees its bytes until it accepts them or raises ``Refusal``.
It knows no socket; ``FirstBytes`` is the one of a port that everybody who reaches it may use.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Final, Protocol

LONGEST: Final = 8 * 1024
"""Bytes that may be held back."""
LONGEST_METHOD: Final = 64
"""Bytes; no protocol has a longer one."""


class Refusal(Exception):
    """The connection is to be closed.

    Attributes:
        answer: what the client is sent before.
        reason: for the log; one of a few constant texts, so that repetitions can be counted.
        delay: seconds to wait before the answer is sent; nothing is read meanwhile.
    """

    def __init__(self, answer: bytes, reason: str, delay: float = 0.0) -> None:
        super().__init__(reason)
        self.answer = answer
        self.reason = reason
        self.delay = delay


class Greeting(Protocol):
    """Decides on a connection by its first bytes, before anything of them is evaluated.

    Attributes:
        welcome_first: the lobby, with its banner, is opened at once and only its input waits; else there is no lobby
            before the bytes are accepted.
        patience: seconds within which the bytes must be accepted; ``math.inf`` for no limit.
        answer: what the client is sent once it is accepted, before its lobby says anything; mostly nothing.
        user: the name of who was let in, "" if nobody was asked.
    """

    welcome_first: bool
    patience: float
    answer: bytes

    @property
    def user(self) -> str:
        """See above."""
        ...

    def take(self, data: bytes) -> bytes | None:
        """More bytes of the client.

        The bytes for the lobby if they are accepted, after which this is not called any more; None if more are needed.
        Raises Refusal.
        """
        ...


Greeter = Callable[[str], Greeting]
"""Makes the greeting of a connection from the address of the client, "" for one of this machine by a UNIX socket."""


def line(text: str) -> bytes:
    """A line for a client that has no lobby."""
    return f"*** urbihw: {text}\n".encode("latin-1", "replace")


_EXPLANATION = "this port takes urbiscript as plain text: use telnet, or urbihw console"


def _http() -> bytes:
    """An answer that an HTTP client can show; without any CORS header, so that no web page may read it."""
    body = line(f"{_EXPLANATION}; it takes nothing from web pages")
    head = (
        "HTTP/1.1 400 Bad Request",
        "Content-Type: text/plain; charset=us-ascii",
        "X-Content-Type-Options: nosniff",
        f"Content-Length: {len(body)}",
        "Connection: close",
    )
    return "\r\n".join((*head, "", "")).encode("ascii") + body


_HTTP: Final = _http()

_METHODS: Final = frozenset(
    # RFC 9110, the preface of HTTP/2, WebDAV and its relatives: the registry of methods of IANA.
    b"GET HEAD POST PUT DELETE CONNECT OPTIONS TRACE PATCH PRI "
    b"ACL BASELINE-CONTROL BIND CHECKIN CHECKOUT COPY LABEL LINK LOCK MERGE MKACTIVITY MKCALENDAR MKCOL MKREDIRECTREF "
    b"MKWORKSPACE MOVE ORDERPATCH PROPFIND PROPPATCH QUERY REBIND REPORT SEARCH UNBIND UNCHECKOUT UNLINK UNLOCK UPDATE "
    b"UPDATEREDIRECTREF VERSION-CONTROL".split()
)
_TOKEN: Final = re.compile(rb"[!#-'*+\-.^_`|~0-9A-Za-z]+")
_TARGET: Final = re.compile(rb"/[^ \r\n]*|\*|[A-Za-z][A-Za-z0-9+.\-]*://[^ \r\n]*")
_TARGET_SO_FAR: Final = re.compile(rb"(/[^ \r\n]*|\*|[A-Za-z][A-Za-z0-9+.\-]*(:(/(/[^ \r\n]*)?)?)?)?")
_VERSION: Final = b"HTTP/"
_BLANKS: Final = b" \t\r\n\v\f"
_CONTROLS: Final = {0x00: "a binary protocol such as STUN", 0x04: "SOCKS", 0x05: "SOCKS", 0x16: "TLS"}


class FirstBytes:
    """Lets in whatever does not begin as another protocol does.

    An ordinary statement is let through by its first bytes.  What is held back is what may still become the first line
    of a request: one word, or a word, a blank and something that begins with ``/``.
    """

    welcome_first = True
    patience = math.inf
    answer = b""
    user = ""

    def __init__(self, peer: str = "") -> None:
        self._held = b""

    def take(self, data: bytes) -> bytes | None:
        """More bytes: all there were if they are urbiscript, None while they may still be something else."""
        self._held += data
        first = self._held.lstrip(_BLANKS)
        if first and _may_be_request(first):
            if len(first) > LONGEST:
                raise Refusal(line(f"a first line of more than {LONGEST} bytes; {_EXPLANATION}"), "endless first line")
            return None
        if not first and len(self._held) <= LONGEST:
            return None
        held, self._held = self._held, b""
        return held


def _may_be_request(first: bytes) -> bool:
    """Whether bytes may still become another protocol's; raises Refusal if they are."""
    if first[0] < 0x20 or first[0] == 0x7F:
        spoken = _CONTROLS.get(first[0], "no text")
        raise Refusal(line(f"this is {spoken}; {_EXPLANATION}"), f"it speaks {spoken}")
    method, blank, rest = first.partition(b" ")
    if not blank:
        if method.startswith(b"SSH-") and method[4:5].isdigit():
            raise Refusal(line(f"this is SSH; {_EXPLANATION}"), "it speaks SSH")
        return len(method) <= LONGEST_METHOD and _TOKEN.fullmatch(method) is not None
    if method in _METHODS:
        raise Refusal(_HTTP, "it speaks HTTP")
    if method == b"PROXY":
        raise Refusal(line(f"this is the PROXY protocol; {_EXPLANATION}"), "it speaks PROXY")
    if _TOKEN.fullmatch(method) is None:
        return False
    target, blank, version = rest.partition(b" ")
    if not blank:
        return _TARGET_SO_FAR.fullmatch(target) is not None
    if _TARGET.fullmatch(target) is None:
        return False
    if version.startswith(_VERSION) and version[5:6].isdigit():
        raise Refusal(_HTTP, "it speaks HTTP")
    return len(version) <= len(_VERSION) and _VERSION.startswith(version)
