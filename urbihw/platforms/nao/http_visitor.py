"""``GET /?eval=Module.method(args)``: a call of a module by HTTP, as brokers of NAOqi 1 answered it (manual, "Writing
NaoQi modules in urbi"; fact sheet, section 12).  No I/O.

One request for each connection.  A call is no page: it may move the robot.  So a page of a web site must not be able to
make a browser send one:

- ``Host`` must be an address or a name of this computer that the settings know (a site could give its own name the
  address of this computer);
- a request that a browser does not call typed by its user, or of the same origin, is refused, and so is one with a
  foreign ``Origin`` or ``Referer``, and a page that is fetched in advance;
- a browser that does not tell (it does so for loopback and ``https`` only) is refused.
"""

from __future__ import annotations

import base64
import binascii
import hmac
import html
import http.client
import io
import ipaddress
import math
import socket
from collections.abc import Callable, Collection, Sequence
from http import HTTPStatus
from typing import Any, Final, Protocol
from urllib.parse import parse_qs, urlsplit

from urbihw.buses.errors import Unavailable
from urbihw.buses.listening import Visitor
from urbihw.buses.qi.login import Login
from urbihw.platforms.nao.literals import parse_call

LARGEST: Final = 8192
"""Bytes of a request."""
REQUEST_TIMEOUT_S: Final = 5.0
"""Seconds in which a request must have come."""
REALM: Final = "urbihw"
LOOPBACK_NAMES: Final = ("localhost", "127.0.0.1", "[::1]")
TRUSTED_SITES: Final = ("none", "same-origin")
"""Values of ``Sec-Fetch-Site``: typed by the user, and our own origin."""


class Ask(Protocol):
    """Starts a call; False when there is no such method, or it may not be called so."""

    def __call__(
        self,
        visitor: HttpVisitor,
        module: str,
        method: str,
        arguments: Sequence[Any],
        then: Callable[[Any, str], None],
    ) -> bool:
        """``then(value, error)`` gets the outcome."""
        ...


class Refusal(Exception):
    """The request is answered with this status and this line."""

    def __init__(self, status: HTTPStatus, text: str) -> None:
        super().__init__(text)
        self.status = status


def find_allowed_hosts(host: str, port: int) -> frozenset[str]:
    """What ``Host`` may be for a server that listens there; names in lower case, with and without the port."""
    address = ipaddress.ip_address(host)
    names = [*LOOPBACK_NAMES, f"[{host}]" if address.version == 6 else host]
    if not address.is_loopback:
        names += [socket.gethostname().lower(), f"{socket.gethostname().lower()}.local"]
    return frozenset(names) | {f"{name}:{port}" for name in names}


class HttpVisitor(Visitor):
    """One connection."""

    def __init__(
        self,
        now: float,
        hosts: Collection[str],
        ask: Ask,
        leave: Callable[[HttpVisitor], None],
        login: Login | None = None,
    ) -> None:
        """``leave(visitor)`` is called when the connection is closed; ``login`` is what a caller must know."""
        super().__init__(now + REQUEST_TIMEOUT_S)
        self._hosts, self._ask, self._leave = hosts, ask, leave
        self._login = login if login is not None else Login()
        self._data = b""
        self._complete = False
        self._begun = False

    # ---------------------------------------------------------------- the request

    def wants_data(self) -> bool:
        """Always: a visitor that leaves is noticed by reading."""
        return True

    def receive(self, data: bytes) -> None:
        """Collect the request; what follows it is dropped."""
        if self._complete:
            return
        self._data += data
        if b"\r\n\r\n" in self._data or b"\n\n" in self._data:
            self._complete = True
        elif len(self._data) > LARGEST:
            self._answer(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, f"a request has {LARGEST} bytes at most")

    def work(self, most: int) -> int:
        """Answer the request once it is there."""
        if not self._complete or self._begun or self.closing or most < 1:
            return 0
        self._begun, self.deadline = True, None
        try:
            self._begin()
        except Refusal as refusal:
            self._answer(refusal.status, str(refusal))
        except ValueError:
            self._answer(HTTPStatus.BAD_REQUEST, "the address cannot be read")
        return 1

    def leave(self) -> None:
        """The connection is closed."""
        self._leave(self)

    def _begin(self) -> None:
        target, headers = _parse_request(self._data[:LARGEST])
        self._check_origin(headers)
        self._check_credentials(headers)
        texts = parse_qs(urlsplit(target).query, max_num_fields=8).get("eval", [])
        if urlsplit(target).path != "/" or len(texts) != 1:
            raise Refusal(HTTPStatus.NOT_FOUND, "write /?eval=Module.method(arguments)")
        try:
            module, method, arguments = parse_call(texts[0])
        except ValueError as error:
            raise Refusal(HTTPStatus.BAD_REQUEST, str(error)) from error
        if not self._ask(self, module, method, arguments, self._end):
            why = f"{module}.{method} is not there, or was not declared with bindUrbiMethod"
            raise Refusal(HTTPStatus.NOT_FOUND, why)

    # ---------------------------------------------------------------- who asks

    def _check_origin(self, headers: http.client.HTTPMessage) -> None:
        if headers.get("Host", "").strip().lower() not in self._hosts:
            raise Refusal(HTTPStatus.FORBIDDEN, "Host is no name of this server: options.module_http_host")
        foreign = [name for name in ("Origin", "Referer") if self._is_foreign(headers.get(name, ""))]
        site = headers.get("Sec-Fetch-Site", "")
        if foreign or (site and site not in TRUSTED_SITES):
            raise Refusal(HTTPStatus.FORBIDDEN, "this call comes from a page of another site")
        if headers.get("Sec-Purpose") or headers.get("Purpose") or headers.get("X-Moz"):
            raise Refusal(HTTPStatus.FORBIDDEN, "a call is not made in advance")
        if not site and "mozilla" in headers.get("User-Agent", "").lower():
            why = "this browser does not tell where the call comes from: use http://localhost, or curl"
            raise Refusal(HTTPStatus.FORBIDDEN, why)

    def _is_foreign(self, origin: str) -> bool:
        if not origin:
            return False
        parts = urlsplit(origin)
        return parts.scheme != "http" or parts.netloc.lower() not in self._hosts

    def _check_credentials(self, headers: http.client.HTTPMessage) -> None:
        try:
            known = ":".join(self._login.words().values())
        except Unavailable as error:
            raise Refusal(HTTPStatus.UNAUTHORIZED, "the password of the robot is not known") from error
        if not known:
            return
        kind, _, coded = headers.get("Authorization", "").partition(" ")
        try:
            given = base64.b64decode(coded, validate=True) if kind.lower() == "basic" else b""
        except (binascii.Error, ValueError):
            given = b""
        if not hmac.compare_digest(given, known.encode()):
            raise Refusal(HTTPStatus.UNAUTHORIZED, "user and password of the robot are needed")

    # ---------------------------------------------------------------- the answer

    def _end(self, value: Any, error: str) -> None:
        if error:
            self._answer(HTTPStatus.INTERNAL_SERVER_ERROR, error)
        else:
            self._answer(HTTPStatus.OK, write_value(value))

    def _answer(self, status: HTTPStatus, text: str) -> None:
        body = f"<HTML><BODY><PRE>{html.escape(text)}</PRE></BODY></HTML>\n".encode()
        head = [
            f"HTTP/1.0 {status.value} {status.phrase}",
            "Content-Type: text/html; charset=utf-8",
            f"Content-Length: {len(body)}",
            "Cache-Control: no-store",
            "Content-Security-Policy: default-src 'none'",
            "X-Content-Type-Options: nosniff",
            "Connection: close",
        ]
        if status == HTTPStatus.UNAUTHORIZED:
            head.append(f'WWW-Authenticate: Basic realm="{REALM}"')
        self.write("\r\n".join(head).encode() + b"\r\n\r\n" + body)
        self.closing = True


def _parse_request(data: bytes) -> tuple[str, http.client.HTTPMessage]:
    """The target and the headers.  Raises Refusal."""
    stream = io.BytesIO(data)
    words = stream.readline().decode("latin-1").split()
    if len(words) != 3 or not words[2].startswith("HTTP/1."):
        raise Refusal(HTTPStatus.BAD_REQUEST, "this is no request of HTTP 1")
    if words[0] != "GET":
        raise Refusal(HTTPStatus.METHOD_NOT_ALLOWED, f"{words[0][:20]} is not answered, only GET")
    try:
        headers = http.client.parse_headers(stream)
    except http.client.HTTPException as error:
        raise Refusal(HTTPStatus.BAD_REQUEST, "the headers cannot be read") from error
    if len(headers.get_all("Host", [])) != 1:
        raise Refusal(HTTPStatus.BAD_REQUEST, "one Host is needed")
    return words[1], headers


def write_value(value: Any) -> str:
    """A value as the literals of a call are written; a text stands without quotes."""
    return value if isinstance(value, str) else _literal(value)


def _literal(value: Any) -> str:
    match value:
        case None:
            return ""
        case bool():
            return "true" if value else "false"
        case float() if math.isfinite(value):
            return f"{value:.15g}"
        case str():
            return "'" + value.replace("\\", "\\\\").replace("'", "\\'") + "'"
        case list() | tuple():
            return f"[{', '.join(map(_literal, value))}]"
        case dict():
            return f"[{', '.join(f'{_literal(key)}: {_literal(each)}' for key, each in value.items())}]"
    return str(value)
