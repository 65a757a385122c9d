"""The pages: the panel, its files, the pairing, the schema of the protocol, and the WebSocket."""

from __future__ import annotations

import asyncio
import html
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Final

from aiohttp import web

from urbihw.daemon.secrets import WrongSecrets
from urbihw.web.connections import Handler
from urbihw.web.guards import Handler as Answer
from urbihw.web.guards import RequestGuard, add_headers, make_middleware
from urbihw.web.pairing import COOKIE_DAYS, Browser

if TYPE_CHECKING:
    from urbihw.web.gateway import Gateway

FOLDER: Final = Path(__file__).parent
_MAX_CODE_LENGTH: Final = 64
FIRST_DELAY_S, MAX_DELAY_S = 0.25, 8.0
"""Seconds by which the answers to wrong codes are delayed: the first one, and the maximum of the doubled delay."""
_PAGE: Final = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<link rel="icon" href="data:,"><link rel="stylesheet" href="/static/style.css">{head}<title>urbihw</title></head>
<body><main class="alone"><section class="card"><h1>{title}</h1><p>{text}</p></section></main></body></html>
"""
_AGAIN: Final = '<meta http-equiv="refresh" content="0;url=/">'
_HOW: Final = "On the robot's machine, type <code>urbihw panel pair</code> and open the address that it shows."


class Pages:
    """The application of aiohttp: ``app``."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._cookie = f"urbihw_{gateway.port}"
        self._attempts = WrongSecrets(FIRST_DELAY_S, MAX_DELAY_S)
        self.app = web.Application(middlewares=[_note_request, make_middleware(RequestGuard())], client_max_size=1024)
        self.app.on_response_prepare.append(add_headers)
        self.app.add_routes([
            web.get("/", self._index),
            web.get("/ws", self._socket),
            web.get("/pair", self._pair),
            web.get("/healthz", self._healthz),
            web.get("/schema.json", self._schema),
            web.static("/static", FOLDER / "static"),
        ])  # fmt: skip

    def _browser(self, request: web.Request) -> Browser | None:
        cookie = request.cookies.get(self._cookie, "")
        if not (0 < len(cookie) <= 200 and cookie.isascii()):
            return None
        browser = self._gateway.pairings.find(cookie, self._gateway.port)
        connection_of(request).is_known = browser is not None
        return browser

    async def _index(self, request: web.Request) -> web.StreamResponse:
        if self._browser(request) is not None:
            return web.FileResponse(FOLDER / "static" / "index.html")
        if request.headers.get("Sec-Fetch-Site") == "cross-site":
            # A link of another site brings no cookie: the page opens itself again, from here.
            return _page(200, "One moment", "", head=_AGAIN)
        return _page(401, "This browser is not paired", _HOW)

    async def _pair(self, request: web.Request) -> web.StreamResponse:
        code = request.query.get("c", "")
        # A program that only looks where a link leads must not use it up.
        if request.method != "GET" or request.headers.get("Sec-Purpose") or request.headers.get("Purpose"):
            return _page(400, "Open this page", "It pairs the browser that opens it.")
        made = self._gateway.pairings.redeem(code, self._gateway.port) if 0 < len(code) <= _MAX_CODE_LENGTH else None
        address = connection_of(request).address
        if made is None:
            self._gateway.limited_log.say(("code", address), "a wrong or old pairing code from %s", request.remote)
            await asyncio.sleep(self._attempts.fail(address))
            return _page(403, "This code is not good any more", "Each is good once, for two minutes. " + _HOW)
        self._attempts.succeed(address)
        browser, cookie = made
        self._gateway.limited_log.say(
            ("paired", address), "browser of %s (%s) paired from %s", browser.name, browser.role, request.remote,
            level=logging.INFO, most=8,
        )  # fmt: skip
        response = web.Response(status=303, headers={"Location": "/"})
        response.set_cookie(
            self._cookie, cookie, httponly=True, samesite="Strict", secure=request.secure, path="/",
            max_age=COOKIE_DAYS * 86400,
        )  # fmt: skip
        return response

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        browser = self._browser(request)
        if browser is None:
            return web.Response(status=401, text="this browser is not paired: urbihw panel pair\n")
        return await self._gateway.connect(request, browser, connection_of(request))

    async def _healthz(self, request: web.Request) -> web.StreamResponse:
        return web.json_response({"ok": True})

    async def _schema(self, request: web.Request) -> web.StreamResponse:
        return web.FileResponse(FOLDER / "protocol.json")


@web.middleware
async def _note_request(request: web.Request, handler: Answer) -> web.StreamResponse:
    connection_of(request).note_request()
    return await handler(request)


def connection_of(request: web.Request) -> Handler:
    """The connection that a request came by."""
    assert isinstance(request.protocol, Handler)
    return request.protocol


def _page(status: int, title: str, text: str, head: str = "") -> web.Response:
    body = _PAGE.format(title=html.escape(title), text=text, head=head)
    return web.Response(status=status, text=body, content_type="text/html")
