"""The connection of a process with remote devices to its server, with reconnection."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable

from urbihw.backoff import BackOff
from urbihw.client.credentials import Credentials
from urbihw.client.dial import dial
from urbihw.client.where import Where
from urbihw.kernel.uremote.bridge import Bridge
from urbihw.kernel.uremote.remote import ProtocolError

log = logging.getLogger("urbihw.remote")

FIRST_PAUSE_S, MAX_PAUSE_S = 0.25, 15.0
"""Seconds before the first attempt to reconnect, and the maximum of the doubled pauses."""
HANDSHAKE_TIMEOUT_S = 10.0
"""Maximum seconds for the server to answer the handshake."""
SLOW_LINK_BYTES = 4 << 20
"""Unsent bytes above which a link counts as slow: then variables wait, and only their latest values are sent."""
NO_COPY_BYTES = 1 << 16


class ServerConnection(asyncio.Protocol):
    """One connection to the server."""

    def __init__(self, bridge: Bridge, drive: Callable[[], None]) -> None:
        """``drive`` runs all ready jobs."""
        self._bridge = bridge
        self._drive = drive
        self.transport: asyncio.Transport | None = None
        loop = asyncio.get_running_loop()
        self.joined: asyncio.Future[None] = loop.create_future()
        """Done when the server has answered the handshake."""
        self.over: asyncio.Future[None] = loop.create_future()
        """Done when the connection is lost."""
        self.slow = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The connection is open: begin the handshake."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        transport.set_write_buffer_limits(high=SLOW_LINK_BYTES, low=SLOW_LINK_BYTES // 4)
        raw = transport.get_extra_info("socket")
        if raw is not None and raw.family in (socket.AF_INET, socket.AF_INET6):
            raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            raw.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            self._bridge.peer = str(transport.get_extra_info("peername")[0])
            self._bridge.local = str(transport.get_extra_info("sockname")[0])

    def data_received(self, data: bytes) -> None:
        """Handle bytes of the server."""
        try:
            self._bridge.receive(data)
        except ProtocolError as error:
            log.error("connection given up: %s", error)
            self.close()
            return
        if self._bridge.ready and not self.joined.done():
            self.joined.set_result(None)
        self._drive()

    def connection_lost(self, error: Exception | None) -> None:
        """The connection is lost."""
        self.transport = None
        if not self.over.done():
            self.over.set_result(None)

    def pause_writing(self) -> None:
        """The server reads more slowly than the devices write."""
        self.slow = True

    def resume_writing(self) -> None:
        """The server has caught up."""
        self.slow = False
        self._bridge.drained()

    def write(self, parts: list[bytes | memoryview]) -> None:
        """Send all parts; large ones are not copied."""
        if self.transport is None:
            return
        small: list[bytes | memoryview] = []
        for part in parts:
            if len(part) < NO_COPY_BYTES:
                small.append(part)
                continue
            if small:
                self.transport.write(b"".join(small))
                small = []
            self.transport.write(part)
        if small:
            self.transport.write(b"".join(small))

    def close(self) -> None:
        """Close the connection at once."""
        if self.transport is not None:
            self.transport.abort()


class RemoteSession:
    """Keeps a connection to one server.  ``current`` is the present connection, None if there is none."""

    def __init__(self, bridge: Bridge, drive: Callable[[], None], where: Where, who: Credentials) -> None:
        self._bridge = bridge
        self._drive = drive
        self._where = where
        self._who = who
        self.current: ServerConnection | None = None
        bridge.congested = lambda: self.current is not None and self.current.slow

    def write(self, parts: list[bytes | memoryview]) -> None:
        """Send data of the bridge; without a connection it is dropped."""
        if self.current is not None:
            self.current.write(parts)

    async def connect(self) -> ServerConnection:
        """Open a connection.  Raises OSError or Denied."""
        _, link = await dial(self._where, self._who, lambda: ServerConnection(self._bridge, self._drive))
        self.current = link
        self._bridge.connected()
        self._drive()
        return link

    async def serve(self, link: ServerConnection, joined: Callable[[], bool]) -> bool:
        """Serve until the connection has ended.  Returns whether the server had answered and ``joined()`` was true."""
        try:
            answered = await self._answer(link)
            if answered and joined():
                await link.over
                return True
            if not answered and not link.over.done():
                log.error("%s does not answer as an Urbi server does", self._where)
            return False
        finally:
            link.close()
            self.current = None
            self._bridge.lost()
            self._drive()

    async def _answer(self, link: ServerConnection) -> bool:
        """Wait until the server has answered, the connection has ended, or the time is over.  Returns whether it has
        answered."""
        await asyncio.wait(
            (link.joined, link.over), timeout=HANDSHAKE_TIMEOUT_S, return_when=asyncio.FIRST_COMPLETED
        )
        return self._bridge.ready

    async def reconnect(self, pauses: BackOff) -> ServerConnection:
        """Open a new connection, with any number of attempts.  Raises Denied."""
        while True:
            await asyncio.sleep(pauses.next_pause())
            try:
                return await self.connect()
            except OSError as error:
                log.debug("still no server: %s", error)
