"""The checks of each HTTP request before it is answered, and the header fields of each answer.

A page of another site that the user visits must neither reach the gateway by a name of its own (DNS rebinding) nor open
the WebSocket, which knows no rule of same origin by itself.
"""

from __future__ import annotations

import ipaddress
import re
import socket
from collections.abc import Awaitable, Callable
from typing import Any, Final

from aiohttp import web

from urbihw.client.where import is_loopback

HEADERS: Final = {
    "Content-Security-Policy": (
        "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' blob: data:; connect-src 'self'; "
        "frame-ancestors 'none'; base-uri 'none'; form-action 'self'; object-src 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
_HOST: Final = re.compile(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+)(?::(\d{1,5}))?")
MAX_PATH: Final = 200
"""Characters of a path: more than any page of the gateway has, fewer than a file system refuses."""
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class RequestGuard:
    """The middleware of the gateway: it refuses foreign hosts, foreign origins and methods that do not read."""

    def __init__(self) -> None:
        name = socket.gethostname().lower()
        short = name.partition(".")[0]
        self._names = {name, short, f"{short}.local"} - {""}

    async def check(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Answer a request, or refuse it: 421 for a foreign host, 403 for a foreign origin, 405 for writing."""
        if not self._is_own_host(request):
            return web.Response(status=421, text="this is not a name or address of this machine\n")
        if request.method not in ("GET", "HEAD"):
            return web.Response(status=405, text="only GET\n", headers={"Allow": "GET, HEAD"})
        if not is_same_origin(request):
            return web.Response(status=403, text="pages of other sites have no access\n")
        if len(request.path) > MAX_PATH:
            return web.Response(status=404, text="there is no such page\n")
        return await handler(request)

    def _is_own_host(self, request: web.Request) -> bool:
        """Whether ``Host`` is this machine: a name of it, or the address to which the browser has connected."""
        match = _HOST.fullmatch(request.headers.get("Host", ""))
        if match is None or len(request.headers.getall("Host")) != 1:
            return False
        host = match[1].strip("[]").lower().rstrip(".")
        if host in self._names:
            return True
        own = _own_address(request)
        if own is None or own.is_loopback:
            return own is not None and is_loopback(host)
        try:
            return ipaddress.ip_address(host) == own
        except ValueError:
            return False


def is_same_origin(request: web.Request) -> bool:
    """Whether a request comes from a page of this gateway, from the user, or from a program.

    A page of this gateway has its own scheme and host as ``Origin``.  A navigation has none, and is allowed from
    anywhere: the cookie does not come with it.
    """
    origins = request.headers.getall("Origin", [])
    scheme = "https" if request.secure else "http"
    if any(origin != f"{scheme}://{request.headers['Host']}" for origin in origins) or len(origins) > 1:
        return False
    site = request.headers.get("Sec-Fetch-Site", "none")
    return site in ("same-origin", "none") or request.headers.get("Sec-Fetch-Mode") == "navigate"


def make_middleware(guard: RequestGuard) -> Any:
    """The guard as aiohttp wants it: it passes the second parameter by its name."""

    @web.middleware
    async def middleware(request: web.Request, handler: Handler) -> web.StreamResponse:
        return await guard.check(request, handler)

    return middleware


async def add_headers(request: web.Request, response: web.StreamResponse) -> None:
    """Add the header fields of each answer, and do not tell the versions of Python and aiohttp."""
    for name, value in HEADERS.items():
        response.headers.setdefault(name, value)
    response.headers["Server"] = "urbihw"


def _own_address(request: web.Request) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    transport = request.transport
    name = transport.get_extra_info("sockname") if transport is not None else None
    if not isinstance(name, tuple):
        return None
    address = ipaddress.ip_address(str(name[0]).partition("%")[0])
    mapped = getattr(address, "ipv4_mapped", None)
    return mapped or address
