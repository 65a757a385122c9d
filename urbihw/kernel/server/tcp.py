"""Listen for clients, over TCP and UNIX sockets, and hold the connections there are.

Each connection has TCP_NODELAY set, and what a lobby says in one scheduler round leaves in one write.  How many clients
there may be is bounded; one more is told so.  What a client does is the affair of its ``Connection``.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import Callable, Iterable
from pathlib import Path
from ssl import SSLContext
from typing import Final

from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.server.connection import Connection, peer_of
from urbihw.kernel.server.departures import Departures
from urbihw.kernel.server.doors import Door, bind, bind_unix, let_go
from urbihw.kernel.server.greeting import FirstBytes, Greeter, Refusal, line
from urbihw.kernel.server.loop import Driver
from urbihw.kernel.server.thinned import Thinned

log = logging.getLogger("urbihw.server")

OpenLobby = Callable[[str | None, Callable[[Lobby], None], int], Lobby]
"""Makes a lobby for (remote address, None for a UNIX socket; what to call when it has something to say; limit of unread
bytes)."""

KEEP_ALIVE: Final = (
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
    (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 4),
    (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 2),
    (socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3),
    (socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 10_000),
)
"""A client that is gone without a word is found within 10 s: what it set in motion must not go on.  The last of them
also ends a connection whose client reads nothing at all for that long although something waits for it."""
MOST_CLIENTS: Final = 256
MOST_STRANGERS: Final = 32
"""Connections by TLS that have not shown yet who they are.  They are counted apart: a crowd of them keeps out others
who come by TLS, but nobody who is in, and nobody of this machine."""
WANTS_TLS: Final = line("this port speaks TLS and wants a token: urbihw console HOST:PORT --tls, or openssl s_client "
                        "-quiet -connect HOST:PORT and then: token TOKEN")
"""What a client reads that speaks plain text to a port of TLS."""
_PLAIN: Final = ("WRONG_VERSION_NUMBER", "HTTP_REQUEST", "HTTPS_PROXY_REQUEST")
"""What OpenSSL says of first bytes that are no TLS of any version."""
HANDSHAKE: Final = 10.0
"""Seconds that TLS may take to begin."""


class Server:
    """The listening side: any number of ways in.

    Attributes:
        limit: how many bytes may wait for a client to read them.
        max_clients: how many clients there may be; one more is told so.
        connections: those there are.
        strangers: the sockets of those who came by TLS and were not let in yet.
        paused: those that are not read from, because they sent much ahead.
        thinned: the log for what clients can repeat.
    """

    def __init__(
        self, driver: Driver, open_lobby: OpenLobby, limit: int = 8 * 1024 * 1024, max_clients: int = MOST_CLIENTS
    ) -> None:
        self.driver = driver
        self.open_lobby = open_lobby
        self.limit = limit
        self.max_clients = max_clients
        self.connections: dict[Connection, None] = {}
        self.strangers: set[socket.socket] = set()
        self.paused: dict[Connection, None] = {}
        self.thinned = Thinned(log)
        self._dirty: dict[Connection, None] = {}
        self._doors: list[Door] = []
        self._arriving: set[asyncio.Task[bool]] = set()
        self._expected: set[socket.socket] = set()
        self._departures: Departures | None = None
        self._loop = asyncio.get_running_loop()
        driver.scheduler.add_round_hook(self._round_over)

    # ---------------------------------------------------------------- ways in

    async def listen(
        self, host: str, port: int, greeting: Greeter = FirstBytes, ssl: SSLContext | None = None
    ) -> int:
        """Listen on all addresses of a host; the port (that which was free, for 0).

        ``greeting`` decides about the first bytes of each connection; with ``ssl`` it is one of TLS.  Raises OSError,
        and UnicodeError for what cannot be the name of a host.
        """
        sockets = bind(host, port)
        number = int(sockets[0].getsockname()[1])
        self.listen_on(sockets, greeting, ssl)
        return number

    async def listen_unix(self, path: Path, greeting: Greeter = FirstBytes, mode: int = 0o660) -> None:
        """Listen on a UNIX socket, whose file has the rights ``mode`` and goes when the server is closed.

        Raises OSError.
        """
        self.listen_on([bind_unix(path, mode)], greeting)

    def listen_on(
        self, sockets: Iterable[socket.socket], greeting: Greeter = FirstBytes, ssl: SSLContext | None = None
    ) -> None:
        """Listen on sockets that are bound, which belong to the server from now on.  Raises OSError."""

        def come(raw: socket.socket) -> None:
            self._come(raw, greeting, ssl)

        remaining = list(sockets)
        made: list[Door] = []
        try:
            while remaining:
                made.append(Door(remaining[0], come, self.thinned))
                remaining.pop(0)
        except OSError:
            for door in made:
                door.close()
            for one in remaining:
                let_go(one)
            raise
        self._doors.extend(made)

    def _come(self, raw: socket.socket, greeting: Greeter, ssl: SSLContext | None) -> None:
        """Somebody connected."""
        if ssl is not None:
            if len(self.strangers) >= MOST_STRANGERS:
                self._turn_away(raw, Refusal(b"", f"{MOST_STRANGERS} others have not shown a token yet"))
                return
            self.strangers.add(raw)
        elif self._clients >= self.max_clients:
            self._turn_away(raw, self._full())
            return
        task = self._loop.create_task(self._arrive(raw, greeting, ssl))
        self._arriving.add(task)
        self._expected.add(raw)

        def arrived(done: asyncio.Task[bool]) -> None:
            self._arriving.discard(done)
            self._expected.discard(raw)
            if done.cancelled():
                raw.close()
            if done.cancelled() or not done.result():
                self.strangers.discard(raw)

        task.add_done_callback(arrived)

    async def _arrive(self, raw: socket.socket, greeting: Greeter, ssl: SSLContext | None) -> bool:
        """Whether there is a connection now."""
        try:
            if raw.family in (socket.AF_INET, socket.AF_INET6):
                raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                for level, option, value in KEEP_ALIVE:
                    raw.setsockopt(level, option, value)
            connection = Connection(self, raw, greeting, ssl is not None)
            # When TLS fails, asyncio closes the socket without a word.
            spare = None if ssl is None else raw.dup()
        except OSError:  # gone already, or there is no descriptor left
            raw.close()
            return False
        patience = HANDSHAKE if ssl is not None else None
        try:
            await self._loop.connect_accepted_socket(
                lambda: connection, raw, ssl=ssl, ssl_handshake_timeout=patience
            )
        except OSError as error:
            if spare is not None:
                text = f"client {connection.peer} refused: it speaks no TLS, which this address wants"
                self.thinned.warning("clients refused: no TLS", text)
                if isinstance(error, ConnectionAbortedError) or getattr(error, "reason", "") in _PLAIN:
                    _send_last(spare, WANTS_TLS)
            return False
        finally:
            if spare is not None:
                spare.close()
        return True

    def _full(self) -> Refusal:
        most = self.max_clients
        told = line(f"too many connections ({most}); close one, or raise max_clients")
        return Refusal(told, f"too many connections ({most})")

    def entered(self, connection: Connection) -> None:
        """A connection is there."""
        self._expected.discard(connection.raw)
        self.connections[connection] = None

    def introduced(self, connection: Connection) -> bool:
        """One who came by TLS has shown who it is, and counts as a client now; False if there are too many."""
        self.strangers.discard(connection.raw)
        if self._clients > self.max_clients:
            connection.refuse(self._full())
            return False
        return True

    @property
    def _clients(self) -> int:
        return len(self.connections) + len(self._expected) - len(self.strangers)

    def _turn_away(self, raw: socket.socket, refusal: Refusal) -> None:
        self.thinned.warning(
            f"clients refused: {refusal.reason}", f"client {peer_of(raw)[1]} refused: {refusal.reason}"
        )
        with raw:
            raw.setblocking(False)
            if refusal.answer:
                _send_last(raw, refusal.answer)

    # ---------------------------------------------------------------- connections

    def departures(self) -> Departures:
        """What watches connections that are not read from.  Raises OSError when there is no descriptor left for it."""
        if self._departures is None:
            self._departures = Departures()
        return self._departures

    def left(self, connection: Connection) -> None:
        """A connection is over."""
        self.connections.pop(connection, None)
        self.strangers.discard(connection.raw)
        self.paused.pop(connection, None)
        for door in self._doors:
            self._loop.call_soon(door.resume)

    def pending(self, connection: Connection) -> Callable[[Lobby], None]:
        """What a lobby calls when it begins to say something."""

        def wanted(lobby: Lobby) -> None:
            self._dirty[connection] = None

        return wanted

    def _round_over(self) -> None:
        while self._dirty:
            connection, _ = self._dirty.popitem()
            connection.flush()
        if self.paused:
            for connection in list(self.paused):
                connection.read_on()

    async def close(self) -> None:
        """Stop listening and close all connections; what was said is sent."""
        for door in self._doors:
            door.close()
        for task in self._arriving:
            task.cancel()
        self._round_over()
        for connection in list(self.connections):
            connection.close()
        await asyncio.sleep(0)
        self.thinned.close()
        if self._departures is not None:
            self._departures.close()
            self._departures = None


def _send_last(raw: socket.socket, text: bytes) -> None:
    """Say something to a client that is not let in, if it can be said at once."""
    with contextlib.suppress(OSError):
        raw.send(text)
        raw.shutdown(socket.SHUT_WR)
