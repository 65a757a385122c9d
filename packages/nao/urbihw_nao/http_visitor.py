"""``GET /?eval=Module.method(args)``: a call of a module by HTTP, as brokers of NAOqi 1 answered it (manual, "Writing
NaoQi modules in urbi"; fact sheet, section 12).  No I/O.

One request for each connection.  A call is no page: it may move the robot.  So a page of a web site must not be able to
make a browser send one:

- ``Host`` must be an address or a name of this computer that the settings know (a site could give its own name the
  address of this computer);
- a browser, which is known by any of its headers, must say in ``Sec-Fetch-Site`` that its user has typed the address,
  or that the page is ours (it does so for loopback and ``https`` only);
- a foreign ``Origin`` or ``Referer``, and a page that is fetched in advance, are refused.

How the request is read: see ``http_request``.
"""

from __future__ import annotations

import base64
import binascii
import hmac
import html
import ipaddress
import math
import socket
from collections.abc import Callable, Collection, Mapping, Sequence
from http import HTTPStatus
from typing import Any, Final, Protocol
from urllib.parse import parse_qs, urlsplit

from urbihw.buses.errors import Unavailable
from urbihw.buses.listening import Visitor
from urbihw_nao.http_request import HeadReader, HttpRefusal
from urbihw_nao.literals import parse_call
from urbihw_nao.qimessaging.login import Login
from urbihw_nao.qimessaging.login_guard import LoginGuard
from urbihw_nao.qimessaging.serving import shorten_error

REQUEST_TIMEOUT_S: Final = 5.0
"""Seconds in which a request must have come."""
REALM: Final = "urbihw"
BYTES_A_UNIT: Final = 256
"""Bytes of a request that count as one more small message: literals take 0.6 ms for each 1000 characters."""
LOOPBACK_NAMES: Final = ("localhost", "127.0.0.1", "[::1]")
TRUSTED_SITES: Final = ("none", "same-origin")
"""Values of ``Sec-Fetch-Site``: typed by the user, and our own origin."""
BROWSER_HEADERS: Final = frozenset(
    ("origin", "referer", "cookie", "accept-language", "dnt", "upgrade-insecure-requests")
)
"""Browsers send these, in lower case, and those that begin with ``sec-``, programs do not."""
IN_ADVANCE: Final = frozenset(("sec-purpose", "purpose", "x-moz", "x-purpose"))
"""Headers of what a browser fetches before its user has asked for it."""


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


def find_allowed_hosts(host: str, port: int) -> frozenset[str]:
    """What ``Host`` may be for a server that listens there; names in lower case, with and without the port."""
    address = ipaddress.ip_address(host)
    names = [*LOOPBACK_NAMES, f"[{host}]" if address.version == 6 else host]
    if not address.is_loopback:
        names += [socket.gethostname().lower(), f"{socket.gethostname().lower()}.local"]
    return frozenset(names) | {f"{name}:{port}" for name in names}


class HttpVisitor(Visitor):
    """One connection of a client of http."""

    def __init__(
        self,
        now: float,
        address: str,
        hosts: Collection[str],
        ask: Ask,
        leave: Callable[[HttpVisitor], None],
        guard: LoginGuard,
        login: Login,
    ) -> None:
        """``leave(visitor)`` is called when the connection is closed; ``login`` is what a caller must know, and
        ``guard`` counts the wrong logins of its address."""
        super().__init__(now + REQUEST_TIMEOUT_S)
        self._address, self._hosts, self._ask, self._leave = address, hosts, ask, leave
        self._guard, self._login = guard, login
        self._head = HeadReader()
        self._begun = False

    # ---------------------------------------------------------------- the request

    def wants_data(self) -> bool:
        """Always: a visitor that leaves is noticed by reading."""
        return True

    def receive(self, data: bytes) -> None:
        """Collect the request; what follows it is dropped."""
        self._head.receive(data)

    def work(self, most: int) -> int:
        """Answer the request once it is there."""
        if not self._head.complete or self._begun or self.closing or most < 1:
            return 0
        self._begun, self.deadline = True, None
        try:
            self._begin()
        except HttpRefusal as refusal:
            self._answer(refusal.status, str(refusal))
        except ValueError:
            self._answer(HTTPStatus.BAD_REQUEST, "the address cannot be read")
        return 1 + self._head.size // BYTES_A_UNIT

    def leave(self) -> None:
        """The connection is closed."""
        self._leave(self)

    def _begin(self) -> None:
        target, headers = self._head.parse()
        self._check_origin(headers)
        self._check_credentials(headers)
        if not target.startswith("/"):
            raise HttpRefusal(HTTPStatus.BAD_REQUEST, "the address begins with /")
        path, _, query = target.partition("?")
        texts = parse_qs(query, max_num_fields=8, errors="strict").get("eval", [])
        if path != "/" or len(texts) != 1:
            raise HttpRefusal(HTTPStatus.NOT_FOUND, "write /?eval=Module.method(arguments)")
        try:
            module, method, arguments = parse_call(texts[0])
        except ValueError as error:
            raise HttpRefusal(HTTPStatus.BAD_REQUEST, str(error)) from error
        if not self._ask(self, module, method, arguments, self._end):
            why = f"{module}.{method} is not there, or was not declared with bindUrbiMethod"
            raise HttpRefusal(HTTPStatus.NOT_FOUND, why)

    # ---------------------------------------------------------------- who asks

    def _check_origin(self, headers: Mapping[str, str]) -> None:
        if headers["host"].lower() not in self._hosts:
            raise HttpRefusal(HTTPStatus.FORBIDDEN, "Host is no name of this server: options.module_http_host")
        if any(self._is_foreign(headers[name]) for name in ("origin", "referer") if name in headers):
            raise HttpRefusal(HTTPStatus.FORBIDDEN, "this call comes from a page of another site")
        if not headers.keys().isdisjoint(IN_ADVANCE):
            raise HttpRefusal(HTTPStatus.FORBIDDEN, "a call is not made in advance")
        if not _comes_from_browser(headers):
            return
        site = headers.get("sec-fetch-site")
        if site is None:
            why = "this browser does not tell where the call comes from: use http://localhost, or curl"
            raise HttpRefusal(HTTPStatus.FORBIDDEN, why)
        if site not in TRUSTED_SITES:
            raise HttpRefusal(HTTPStatus.FORBIDDEN, "this call comes from a page of another site")

    def _is_foreign(self, origin: str) -> bool:
        parts = urlsplit(origin)
        return parts.scheme != "http" or parts.netloc.lower() not in self._hosts

    def _check_credentials(self, headers: Mapping[str, str]) -> None:
        try:
            known = ":".join(self._login.words().values())
        except Unavailable as error:
            raise HttpRefusal(HTTPStatus.UNAUTHORIZED, "the password of the robot is not known") from error
        if not known:
            return
        if refusal := self._guard.find_refusal(self._address):
            raise HttpRefusal(HTTPStatus.TOO_MANY_REQUESTS, refusal)
        kind, _, coded = headers.get("authorization", "").partition(" ")
        try:
            given = base64.b64decode(coded, validate=True) if kind.lower() == "basic" else b""
        except (binascii.Error, ValueError):
            given = b""
        if hmac.compare_digest(given, known.encode()):
            return
        if "authorization" in headers:
            # A browser asks without a password first.
            self._guard.count_wrong(self._address)
        raise HttpRefusal(HTTPStatus.UNAUTHORIZED, "user and password of the robot are needed")

    # ---------------------------------------------------------------- the answer

    def _end(self, value: Any, error: str) -> None:
        if error:
            self._answer(HTTPStatus.INTERNAL_SERVER_ERROR, error)
        else:
            self._answer(HTTPStatus.OK, write_value(value))

    def _answer(self, status: HTTPStatus, text: str) -> None:
        if status != HTTPStatus.OK:
            text = shorten_error(text)
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


def _comes_from_browser(headers: Mapping[str, str]) -> bool:
    if any(name in BROWSER_HEADERS or name.startswith("sec-") for name in headers):
        return True
    return "mozilla" in headers.get("user-agent", "").lower()


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
