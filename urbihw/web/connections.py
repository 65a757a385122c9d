"""The TCP connections of the gateway: accepted, bounded and ended.

Every computer that reaches the port may open connections, so those that have not shown the cookie of a paired
browser, the strangers, are few: a new one takes the place of the oldest one.  A paired browser shows its cookie with
its first request, and then no stranger takes its place.  A connection without a whole request for ``IDLE_S`` is closed.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
import socket
from collections import Counter
from collections.abc import AsyncIterator
from ssl import SSLContext
from typing import Any, Final

from aiohttp import web

from urbihw.repeats import LimitedLog

log = logging.getLogger("urbihw.web")

IDLE_S: Final = 20.0
"""Seconds without the head of a request, and for an answer to be sent, after which a connection is closed."""
HANDSHAKE_S: Final = 10.0
"""Seconds for the handshake of TLS."""
MAX_CONNECTIONS: Final = 256
MAX_STRANGERS: Final = 64
MAX_STRANGERS_OF_ADDRESS: Final = 24
"""A browser that loads the page opens six."""
RECEIVE_BUFFER_BYTES: Final = 64 * 1024
"""Bytes that the system takes from a browser beforehand: so many of its requests are read in one turn at most."""
MAX_FIELD: Final = 4096
"""Bytes of a field of a head."""
MAX_FIELDS: Final = 64
MAX_AHEAD_BYTES: Final = 64 * 1024
"""Bytes from the head of one request to that of the next one.  Older versions of aiohttp do not bound the fields, none
bounds what is sent before the answer."""
_PAUSE_S: Final = 0.2
"""Seconds until the next attempt to accept when the system has no descriptor left."""


class Handler(web.RequestHandler):
    """The protocol of one connection.

    Attributes:
        address: where it comes from, as ``origin_of`` tells it.
        is_known: whether it has shown the cookie of a paired browser.
        is_socket: whether it has become a WebSocket, which has its own signs of life.
    """

    __slots__ = ("_ahead", "_timer", "address", "gone", "is_known", "is_socket")

    def __init__(self, server: web.Server, address: str) -> None:
        loop = asyncio.get_running_loop()
        super().__init__(
            server, loop=loop, max_line_size=MAX_FIELD, max_field_size=MAX_FIELD,
            max_headers=MAX_FIELDS, lingering_time=2.0,
        )  # fmt: skip
        self.address = address
        self.is_known = self.is_socket = False
        self.gone = asyncio.Event()
        self._ahead = 0
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The connection is open."""
        super().connection_made(transport)
        self.note_request()

    def connection_lost(self, exc: BaseException | None) -> None:
        """The connection has ended."""
        self._stop_timer()
        super().connection_lost(exc)
        self.gone.set()

    def data_received(self, data: bytes) -> None:
        self._ahead += len(data)
        if self._ahead > MAX_AHEAD_BYTES and not self.is_socket:
            self._abort()
        else:
            super().data_received(data)

    def note_request(self) -> None:
        """The head of a request has come: the next one has its time."""
        self._stop_timer()
        self._ahead = 0
        self._timer = asyncio.get_running_loop().call_later(IDLE_S, self._abort)

    def note_socket(self) -> None:
        """The connection has become a WebSocket."""
        self._stop_timer()
        self.is_socket = True

    def handle_error(
        self,
        request: web.BaseRequest,
        status: int = 500,
        exc: BaseException | None = None,
        message: str | None = None,
    ) -> web.StreamResponse:
        """The answer to what is no request, or where the gateway fails: it tells nothing of what answers."""
        if status >= 500:
            log.error("our bug in the gateway: %s: %s", type(exc).__name__, exc)
        text = "the gateway failed: this is our bug\n" if status >= 500 else "this is no request that can be read\n"
        answer = web.Response(status=status, text=text, headers={"Server": "urbihw"})
        answer.force_close()
        return answer

    def _abort(self) -> None:
        if self.transport is not None:
            self.transport.abort()

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()


class _Connection:
    """A connection from its acceptance on, when TLS is not there yet."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.handler: Handler | None = None
        self.task: asyncio.Task[None]

    @property
    def is_known(self) -> bool:
        return self.handler is not None and self.handler.is_known

    @property
    def is_socket(self) -> bool:
        return self.handler is not None and self.handler.is_socket


class Connections:
    """Accepts connections; ``open`` are those that are there, the oldest first."""

    def __init__(self, runner: web.AppRunner, listener: socket.socket, tls: SSLContext | None = None) -> None:
        """``runner`` is set up; ``listener`` listens."""
        assert runner.server is not None
        self._server = runner.server
        self._listener = listener
        self._tls = tls
        self._limited_log = LimitedLog(log)
        self.open: list[_Connection] = []

    async def run(self) -> None:
        """Accept until it is cancelled."""
        loop = asyncio.get_running_loop()
        self._listener.setblocking(False)
        try:
            while True:
                try:
                    plain, peer = await loop.sock_accept(self._listener)
                except OSError as error:  # no descriptor is left, or the peer is gone again
                    self._limited_log.say("accept", "cannot accept a connection: %s", error.strerror or error)
                    await asyncio.sleep(_PAUSE_S)
                    continue
                self._admit(plain, origin_of(peer))
        finally:
            self._limited_log.close()
            for each in list(self.open):
                self._drop(each)

    def _admit(self, plain: socket.socket, address: str) -> None:
        self._make_room(address)
        made = _Connection(address)
        self.open.append(made)
        made.task = asyncio.get_running_loop().create_task(self._attend(made, plain))

    async def _attend(self, made: _Connection, plain: socket.socket) -> None:
        """Keep a connection in the list until it has ended."""
        loop = asyncio.get_running_loop()
        handshake = HANDSHAKE_S if self._tls is not None else None
        try:
            plain.setblocking(False)
            with contextlib.suppress(OSError):
                plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
            _, handler = await loop.connect_accepted_socket(
                lambda: Handler(self._server, made.address), plain, ssl=self._tls, ssl_handshake_timeout=handshake
            )
            made.handler = handler
            await handler.gone.wait()
        except OSError:  # TLS failed or took too long, or the peer is gone
            plain.close()
        finally:
            if made in self.open:
                self.open.remove(made)

    def _make_room(self, address: str) -> None:
        """End a connection when there would be too many."""
        strangers = [each for each in self.open if not each.is_known]
        counts = Counter(each.address for each in strangers)
        if counts[address] >= MAX_STRANGERS_OF_ADDRESS:
            self._replace(strangers, address)
        elif len(strangers) >= MAX_STRANGERS:
            self._replace(strangers, counts.most_common(1)[0][0])
        elif len(self.open) >= MAX_CONNECTIONS:
            # Browsers open again what they need.  There are fewer WebSockets than that.
            self._drop(next(each for each in self.open if not each.is_socket))

    def _replace(self, strangers: list[_Connection], address: str) -> None:
        self._limited_log.say(address, "too many connections of %s that are not paired: the oldest is closed", address)
        self._drop(next(each for each in strangers if each.address == address))

    def _drop(self, connection: _Connection) -> None:
        self.open.remove(connection)
        if connection.handler is None:
            connection.task.cancel()
        elif connection.handler.transport is not None:
            connection.handler.transport.abort()


@contextlib.asynccontextmanager
async def accepting(
    app: web.Application, listener: socket.socket, tls: SSLContext | None
) -> AsyncIterator[Connections]:
    """Serve an application while the block runs; the connections end with it."""
    runner = web.AppRunner(app, access_log=None, handle_signals=False, shutdown_timeout=2.0)
    await runner.setup()
    made = Connections(runner, listener, tls)
    running = asyncio.create_task(made.run())
    try:
        yield made
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await runner.cleanup()


def origin_of(peer: Any) -> str:
    """Where a connection comes from, for counting: an IPv4 address, or the network of 64 bits of an IPv6 address, all
    of which one machine can use."""
    try:
        address = ipaddress.ip_address(str(peer[0]).partition("%")[0])
    except (ValueError, IndexError, TypeError):
        return ""
    mapped = getattr(address, "ipv4_mapped", None)
    if mapped is not None or address.version == 4:
        return str(mapped or address)
    return str(ipaddress.ip_network((address, 64), strict=False))
