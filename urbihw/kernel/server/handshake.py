"""Protocol detection: decides by the first bytes of a connection whether the client speaks urbiscript.

A web page can make a browser on this machine send bytes to 127.0.0.1, and the request line in front of them (``POST /
HTTP/1.1``) would be skipped as a syntax error.  So a connection that begins like another protocol is closed before any
of its input is evaluated.  A web page controls the path and what follows, but never the first bytes: they are a method
and a blank, or the first record of TLS, STUN or SSH.  Mail, FTP, IRC, Redis and others are refused for the same
reason: a program that was led to this port by mistake must not move a robot.

Each connection has a ``Handshake``, which gets the bytes until it accepts them or raises ``HandshakeRefusal``.  It has
no access to the socket.  ``PlainHandshake`` is the one of a port without authentication.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Final, Protocol

MAX_HELD_BACK: Final = 8 * 1024
"""Maximum number of bytes held back while the protocol is not known."""
MAX_METHOD_BYTES: Final = 64
"""Maximum length of a request method, in bytes; no protocol has a longer one."""


class HandshakeRefusal(Exception):
    """Raised by a handshake: the connection must be closed.

    Attributes:
        answer: bytes to send to the client before closing.
        reason: text for the log; one of a few constants, so that repetitions can be counted.
        delay: seconds to wait before the answer is sent; reading pauses meanwhile.
    """

    def __init__(self, answer: bytes, reason: str, delay: float = 0.0) -> None:
        super().__init__(reason)
        self.answer = answer
        self.reason = reason
        self.delay = delay


class Handshake(Protocol):
    """Accepts or refuses a connection by its first bytes, before any of them is evaluated.

    Attributes:
        welcome_first: open the lobby and send its banner at once, and delay only the input; else the lobby is opened
            when the bytes are accepted.
        timeout: seconds within which the handshake must complete; ``math.inf`` for no limit.
        answer: bytes to send when the client is accepted, before the output of its lobby; mostly none.
        user: name of the authenticated user; "" without authentication.
    """

    welcome_first: bool
    timeout: float
    answer: bytes

    @property
    def user(self) -> str:
        """Name of the authenticated user; "" without authentication."""
        ...

    def check_bytes(self, data: bytes) -> bytes | None:
        """Check more bytes of the client.

        Returns the bytes that belong to the lobby once the client is accepted (then this is not called again), and None
        while more are needed.  Raises HandshakeRefusal.
        """
        ...


HandshakeFactory = Callable[[str], Handshake]
"""Makes the handshake of a connection from the client's address, which is "" for a UNIX socket."""


def line(text: str) -> bytes:
    """Format a system line for a client that has no lobby."""
    return f"*** urbihw: {text}\n".encode("latin-1", "replace")


_EXPLANATION = "this port takes urbiscript as plain text: use telnet, or urbihw console"


def _http() -> bytes:
    """An answer that an HTTP client can show.  It has no CORS header, so no web page can read it."""
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
    # Methods of RFC 9110, the HTTP/2 preface, and WebDAV with its extensions (IANA registry of HTTP methods).
    b"GET HEAD POST PUT DELETE CONNECT OPTIONS TRACE PATCH PRI "
    b"ACL BASELINE-CONTROL BIND CHECKIN CHECKOUT COPY LABEL LINK LOCK MERGE MKACTIVITY MKCALENDAR MKCOL MKREDIRECTREF "
    b"MKWORKSPACE MOVE ORDERPATCH PROPFIND PROPPATCH QUERY REBIND REPORT SEARCH UNBIND UNCHECKOUT UNLINK UNLOCK UPDATE "
    b"UPDATEREDIRECTREF VERSION-CONTROL".split()
)
_TOKEN: Final = re.compile(rb"[!#-'*+\-.^_`|~0-9A-Za-z]+")
_TARGET: Final = re.compile(rb"/[^ \r\n]*|\*|[A-Za-z][A-Za-z0-9+.\-]*://[^ \r\n]*")
_TARGET_SO_FAR: Final = re.compile(rb"(/[^ \r\n]*|\*|[A-Za-z][A-Za-z0-9+.\-]*(:(/(/[^ \r\n]*)?)?)?)?")
_VERSION: Final = re.compile(rb"(HTTP|RTSP|SIP)/[0-9].*", re.DOTALL | re.IGNORECASE)
"""The end of a request line."""
_VERSION_SO_FAR: Final = re.compile(rb"(H(T(TP?)?)?|R(T(SP?)?)?|S(IP?)?|HTTP/|RTSP/|SIP/)?", re.IGNORECASE)
_COMMANDS: Final = frozenset(b"HELO EHLO LHLO MAIL RCPT USER PASS NICK CAP JOIN AUTH HELLO PING".split())
"""First words of SMTP (RFC 5321), LMTP (RFC 2033), FTP (RFC 959), POP3, IRC and Redis.  A blank and a word follow them,
which is no statement of urbiscript."""
_ARGUMENT: Final = re.compile(rb"#|(?!(?:in|and|or|xor|bit|not_eq)\w*\b)\w+\b(?=.)", re.DOTALL)
"""The word behind one of them, when it is complete.  Operators of urbiscript do not count."""
_ARGUMENT_SO_FAR: Final = re.compile(rb"\w*")
_KEY: Final = rb"[\w:.\-]+"
_LINES: Final = (
    (re.compile(rb"\*[0-9]+\r\n|PING\r?\n"), re.compile(rb"\*[0-9]*\r?|PING\r"), "Redis"),
    (re.compile(rb"[A-Za-z]{0,4}[0-9]{1,6} (?:AUTHENTICATE|CAPABILITY|LOGIN|NOOP|STARTTLS)[ \r\n]"),
     re.compile(rb"[A-Za-z]{0,4}[0-9]{1,6} [A-Z]{0,12}"), "IMAP"),
    # `get x` alone may begin a getter, and `stats` a statement.
    (re.compile(rb"(?:set|add|replace|append|prepend) %b [0-9]+ -?[0-9]+ [0-9]+[ \r\n]|gets %b[ \r\n]|get %b %b[ \r\n]"
                % ((_KEY,) * 4)),
     re.compile(rb"(?:set|add|replace|append|prepend) (?:%b(?: [0-9]*(?: -?[0-9]*(?: [0-9]*)?)?)?)?"
                rb"|gets? (?:%b(?: (?:%b)?)?)?" % ((_KEY,) * 3)), "memcached"),
    (re.compile(rb"<[?!/A-Za-z]"), re.compile(rb"<"), "XML"),
)  # fmt: skip
"""Beginnings that are no statement of urbiscript, those that may become one, and what speaks so: Redis, IMAP (RFC
9051), memcached (its protocol.txt), XML and HTML."""
_BLANKS: Final = b" \t\r\n\v\f"
_CONTROLS: Final = {0x00: "a binary protocol such as STUN", 0x04: "SOCKS", 0x05: "SOCKS", 0x16: "TLS"}


class PlainHandshake:
    """Accepts every connection that does not begin like another protocol.

    An ordinary statement is accepted by its first bytes.  Bytes are held back while they may become a request line: one
    word, or a word, a blank and a path that begins with ``/``.
    """

    welcome_first = True
    timeout = math.inf
    answer = b""
    user = ""

    def __init__(self, peer: str = "") -> None:
        self._held = b""

    def check_bytes(self, data: bytes) -> bytes | None:
        """All bytes received so far if they are urbiscript; None while they may be another protocol.  Raises
        HandshakeRefusal."""
        self._held += data
        first = self._held.lstrip(_BLANKS)
        if first and _may_be_request(first):
            if len(first) > MAX_HELD_BACK:
                told = line(f"a first line of more than {MAX_HELD_BACK} bytes; {_EXPLANATION}")
                raise HandshakeRefusal(told, "endless first line")
            return None
        if not first and len(self._held) <= MAX_HELD_BACK:
            return None
        held, self._held = self._held, b""
        return held


def _may_be_request(first: bytes) -> bool:
    """Whether the bytes may become another protocol.  Raises HandshakeRefusal if they already are."""
    if first[0] < 0x20 or first[0] == 0x7F:
        spoken = _CONTROLS.get(first[0], "no text")
        raise HandshakeRefusal(line(f"this is {spoken}; {_EXPLANATION}"), f"it speaks {spoken}")
    for whole, so_far, spoken in _LINES:
        if whole.match(first):
            raise HandshakeRefusal(line(f"this is {spoken}; {_EXPLANATION}"), f"it speaks {spoken}")
        if so_far.fullmatch(first):
            return True
    method, blank, rest = first.partition(b" ")
    if not blank:
        if method.startswith(b"SSH-") and method[4:5].isdigit():
            raise HandshakeRefusal(line(f"this is SSH; {_EXPLANATION}"), "it speaks SSH")
        return len(method) <= MAX_METHOD_BYTES and _TOKEN.fullmatch(method) is not None
    if method in _METHODS:
        raise HandshakeRefusal(_HTTP, "it speaks HTTP")
    if method == b"PROXY":
        raise HandshakeRefusal(line(f"this is the PROXY protocol; {_EXPLANATION}"), "it speaks PROXY")
    if method.upper() in _COMMANDS:
        if _ARGUMENT.match(rest):
            raise HandshakeRefusal(line(f"this is mail, FTP, IRC or Redis; {_EXPLANATION}"),
                                   "it speaks mail, FTP, IRC or Redis")
        return _ARGUMENT_SO_FAR.fullmatch(rest) is not None
    if _TOKEN.fullmatch(method) is None:
        return False
    target, blank, version = rest.partition(b" ")
    if not blank:
        return _TARGET_SO_FAR.fullmatch(target) is not None
    if _TARGET.fullmatch(target) is None:
        return False
    if _VERSION.fullmatch(version):
        raise HandshakeRefusal(_HTTP, "it speaks HTTP")
    return _VERSION_SO_FAR.fullmatch(version) is not None
