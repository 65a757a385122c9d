"""Accept connections and move bytes between them and their lobbies.

Each connection has TCP_NODELAY set, and what a lobby says in one scheduler round leaves in one write.  A client that
does not read is given up when more than the limit waits for it; its neighbours notice nothing.
"""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable
from typing import Final

from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.server.loop import Driver

log = logging.getLogger("urbihw.server")

OpenLobby = Callable[[str, Callable[[Lobby], None], int], Lobby]
"""Makes a lobby for (remote address, what to call when it has something to say, limit of unread bytes)."""

CHUNK = 64 * 1024
KEEP_ALIVE: Final = (
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
    (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 4),
    (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 2),
    (socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3),
    (socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 10_000),
)
"""A client that is gone without a word is found within 10 s: what it set in motion must not go on."""


class Connection(asyncio.Protocol):
    """One client."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self._transport: asyncio.Transport | None = None
        self.lobby: Lobby | None = None
        self.peer = "?"

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A client is there: give it a lobby and the banner."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        peer = transport.get_extra_info("peername") or ("?", 0)
        self.peer = f"{peer[0]}:{peer[1]}"
        raw = transport.get_extra_info("socket")
        if raw is not None and raw.family in (socket.AF_INET, socket.AF_INET6):
            raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for level, option, value in KEEP_ALIVE:
                raw.setsockopt(level, option, value)
        self._server.connections[self] = None
        self.lobby = self._server.open_lobby(str(peer[0]), self._server.pending(self), self._server.limit)
        self.lobby.on_quit = self._quit
        self._server.driver.drive()

    def data_received(self, data: bytes) -> None:
        """Bytes from the client."""
        if self.lobby is not None:
            self.lobby.feed(data)
            self._server.driver.drive()

    def connection_lost(self, error: Exception | None) -> None:
        """The client is gone."""
        self._server.connections.pop(self, None)
        if self.lobby is not None:
            self.lobby.close()
            self._server.driver.drive()

    def flush(self) -> None:
        """Send what the lobby said."""
        if self.lobby is None or self._transport is None or self._transport.is_closing():
            return
        data = self.lobby.output.take()
        if data:
            self._transport.write(data)
        if self._transport.get_write_buffer_size() > self._server.limit:
            log.warning("client %s does not read: closed with %d unread bytes", self.peer,
                        self._transport.get_write_buffer_size())
            self._transport.abort()

    def _quit(self) -> None:
        self.flush()
        if self._transport is not None:
            self._transport.close()

    def close(self) -> None:
        """Send what there is and close."""
        self._quit()


class Server:
    """The listening side.  ``limit`` is how many unread bytes a client may pile up."""

    def __init__(self, driver: Driver, open_lobby: OpenLobby, limit: int = 8 * 1024 * 1024) -> None:
        self.driver = driver
        self.open_lobby = open_lobby
        self.limit = limit
        self.connections: dict[Connection, None] = {}
        self._dirty: dict[Connection, None] = {}
        self._server: asyncio.Server | None = None
        driver.scheduler.add_round_hook(self._flush)

    async def listen(self, host: str, port: int) -> int:
        """Listen; the port (that which was free, for 0).  Raises OSError."""
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(lambda: Connection(self), host, port, backlog=128)
        return int(self._server.sockets[0].getsockname()[1])

    def pending(self, connection: Connection) -> Callable[[Lobby], None]:
        """What a lobby calls when it begins to say something."""

        def wanted(lobby: Lobby) -> None:
            self._dirty[connection] = None

        return wanted

    def _flush(self) -> None:
        while self._dirty:
            connection, _ = self._dirty.popitem()
            connection.flush()

    async def close(self) -> None:
        """Stop listening and close all connections; what was said is sent."""
        if self._server is not None:
            self._server.close()
        self._flush()
        for connection in list(self.connections):
            connection.close()
        await asyncio.sleep(0)
