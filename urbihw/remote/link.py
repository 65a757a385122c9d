"""The connection of a process with remote devices to its server: kept, lost, and made again."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable

from urbihw.client.credentials import Credentials
from urbihw.client.dial import dial
from urbihw.client.where import Where
from urbihw.kernel.server.loop import Driver
from urbihw.kernel.uremote.bridge import Bridge
from urbihw.kernel.uremote.remote import Garbage

log = logging.getLogger("urbihw.remote")

FIRST_PAUSE, LONGEST_PAUSE = 0.25, 15.0
"""Seconds before the first attempt to come back, and the most that the doubled pauses grow to."""
PATIENCE = 10.0
"""Seconds in which a server has to answer the greeting."""
MUCH = 4 << 20
"""How many unsent bytes make a link slow: then variables wait, and only their latest values are sent."""
LARGE = 1 << 16


class Link(asyncio.Protocol):
    """One connection."""

    def __init__(self, bridge: Bridge, driver: Driver) -> None:
        self._bridge = bridge
        self._driver = driver
        self.transport: asyncio.Transport | None = None
        self.over = asyncio.get_running_loop().create_future()
        self.slow = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The server is there."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        transport.set_write_buffer_limits(high=MUCH, low=MUCH // 4)
        raw = transport.get_extra_info("socket")
        if raw is not None and raw.family in (socket.AF_INET, socket.AF_INET6):
            raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            raw.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            self._bridge.peer = str(transport.get_extra_info("peername")[0])
            self._bridge.local = str(transport.get_extra_info("sockname")[0])

    def data_received(self, data: bytes) -> None:
        """Bytes of the server."""
        try:
            self._bridge.receive(data)
        except Garbage as error:
            log.error("connection given up: %s", error)
            self.close()
            return
        self._driver.drive()

    def connection_lost(self, error: Exception | None) -> None:
        """The server is gone."""
        self.transport = None
        if not self.over.done():
            self.over.set_result(None)

    def pause_writing(self) -> None:
        """The server does not read as fast as we write."""
        self.slow = True

    def resume_writing(self) -> None:
        """It has caught up."""
        self.slow = False
        self._bridge.drained()

    def write(self, parts: list[bytes | memoryview]) -> None:
        """Send; what is large is not copied."""
        if self.transport is None:
            return
        small: list[bytes | memoryview] = []
        for part in parts:
            if len(part) < LARGE:
                small.append(part)
                continue
            if small:
                self.transport.write(b"".join(small))
                small = []
            self.transport.write(part)
        if small:
            self.transport.write(b"".join(small))

    def close(self) -> None:
        """Hang up at once."""
        if self.transport is not None:
            self.transport.abort()


class Session:
    """Stays joined to one server.  ``current`` is the connection there is at present."""

    def __init__(self, bridge: Bridge, driver: Driver, where: Where, who: Credentials) -> None:
        self._bridge = bridge
        self._driver = driver
        self._where = where
        self._who = who
        self.current: Link | None = None
        bridge.congested = lambda: self.current is not None and self.current.slow

    def write(self, parts: list[bytes | memoryview]) -> None:
        """The bridge's way out."""
        if self.current is not None:
            self.current.write(parts)

    async def connect(self) -> Link:
        """A connection; raises OSError or Denied."""
        _, link = await dial(self._where, self._who, lambda: Link(self._bridge, self._driver))
        self.current = link
        self._bridge.connected()
        self._driver.drive()
        return link

    async def serve(self, link: Link, joined: Callable[[], bool]) -> bool:
        """Until the connection is over.  Whether we had joined: the server answered, and ``joined()`` agrees."""
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
            self._driver.drive()

    async def _answer(self, link: Link) -> bool:
        waited = 0.0
        while not self._bridge.ready and not link.over.done() and waited < PATIENCE:
            await asyncio.sleep(0.02)
            waited += 0.02
        return self._bridge.ready

    async def come_back(self, pause: float) -> tuple[Link, float]:
        """A new connection, however long it takes; the pause before the next attempt should it not last.

        Raises Denied.
        """
        while True:
            await asyncio.sleep(pause)
            try:
                return await self.connect(), min(2 * pause, LONGEST_PAUSE)
            except OSError as error:
                log.debug("still no server: %s", error)
                pause = min(2 * pause, LONGEST_PAUSE)
