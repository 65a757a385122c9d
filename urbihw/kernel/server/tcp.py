"""The server: listens for clients on TCP and UNIX sockets, and keeps the open connections.

Each TCP connection has TCP_NODELAY set, and the output of a lobby in one scheduler round leaves in one write.  The
number of clients is limited; further ones get a line that says so.  The ``LobbyConnection`` handles the input of a
client.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from ssl import SSLContext
from typing import Final

from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.arrivals import UnreadInput
from urbihw.kernel.server.acceptor import Acceptor, bind, bind_unix, release_socket
from urbihw.kernel.server.connection import LobbyConnection, peer_of, unread_size
from urbihw.kernel.server.disconnects import DisconnectWatcher
from urbihw.kernel.server.handshake import HandshakeFactory, HandshakeRefusal, PlainHandshake, line
from urbihw.kernel.server.loop import LoopDriver
from urbihw.repeats import LimitedLog

log = logging.getLogger("urbihw.server")

OpenLobby = Callable[[str | None, Callable[[Lobby], None], int], Lobby]
"""Opens a lobby.  Arguments: the remote address (None for a UNIX socket), a callback for the first output of a round,
the limit of unread bytes."""

KEEP_ALIVE: Final = (
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
    (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 4),
    (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 2),
    (socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3),
    (socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 10_000),
)
"""Detect a client that vanished within 10 s: the motion that it started must not go on.  TCP_USER_TIMEOUT also ends a
connection whose client reads nothing for so long although output waits for it."""
MAX_CLIENTS: Final = 256
MAX_UNAUTHENTICATED: Final = 32
"""Maximum number of TLS connections that have not authenticated.  They are counted apart: many of them keep out other
TLS clients, but neither authenticated clients nor those of this machine."""
WANTS_TLS: Final = line("this port speaks TLS and wants a token: urbihw console HOST:PORT --tls, or openssl s_client "
                        "-quiet -connect HOST:PORT and then: token TOKEN")
"""The answer to a client that sends plain text to a TLS port."""
_PLAIN: Final = ("WRONG_VERSION_NUMBER", "HTTP_REQUEST", "HTTPS_PROXY_REQUEST")
"""The reasons that OpenSSL gives for first bytes that are no TLS of any version."""
TLS_TIMEOUT_S: Final = 10.0
"""Maximum seconds of a TLS handshake."""


class Server:
    """Accepts clients on any number of listening sockets.

    Attributes:
        limit: maximum number of unread output bytes of a client.
        max_clients: maximum number of clients; further ones are refused with a line that says so.
        connections: the open connections, in the order of their beginning.
        unauthenticated: the sockets of TLS clients that have not authenticated yet.
        paused: the connections whose reading pauses because of much pending input.
        limited_log: the log for events that clients can repeat.
        overheard: called with a connection, ">" or "<", and what its accepted client sent or gets; None: not called.
    """

    def __init__(
        self, driver: LoopDriver, open_lobby: OpenLobby, limit: int = 8 * 1024 * 1024, max_clients: int = MAX_CLIENTS
    ) -> None:
        self.driver = driver
        self.open_lobby = open_lobby
        self.limit = limit
        self.max_clients = max_clients
        self.connections: dict[LobbyConnection, None] = {}
        self.unauthenticated: set[socket.socket] = set()
        self.paused: dict[LobbyConnection, None] = {}
        self.limited_log = LimitedLog(log)
        self.overheard: Callable[[LobbyConnection, str, bytes], None] | None = None
        self._dirty: dict[LobbyConnection, None] = {}
        self._acceptors: list[Acceptor] = []
        self._arriving: set[asyncio.Task[bool]] = set()
        self._expected: set[socket.socket] = set()
        self._unread: dict[UnreadInput, None] = {}
        """What is not read of all clients that were accepted."""
        self._disconnect_watcher: DisconnectWatcher | None = None
        self._loop = asyncio.get_running_loop()
        driver.scheduler.add_round_hook(self._round_over)
        driver.scheduler.add_era_hook(self._end_era)

    # ---------------------------------------------------------------- ways in

    async def listen(
        self, host: str, port: int, handshake: HandshakeFactory = PlainHandshake, ssl: SSLContext | None = None
    ) -> int:
        """Listen on all addresses of a host.  Returns the port, which for 0 is a free one.

        ``handshake`` makes the handshake of each connection; with ``ssl`` the connections use TLS.  Raises OSError, and
        UnicodeError for an impossible host name.
        """
        sockets = bind(host, port)
        number = int(sockets[0].getsockname()[1])
        self.listen_on(sockets, handshake, ssl)
        return number

    async def listen_unix(self, path: Path, handshake: HandshakeFactory = PlainHandshake, mode: int = 0o660) -> None:
        """Listen on a UNIX socket.  Its file has the permissions ``mode`` and is removed when the server is closed.

        Raises OSError.
        """
        self.listen_on([bind_unix(path, mode)], handshake)

    def listen_on(
        self,
        sockets: Iterable[socket.socket],
        handshake: HandshakeFactory = PlainHandshake,
        ssl: SSLContext | None = None,
    ) -> None:
        """Listen on bound sockets, which the server owns from now on.  Raises OSError."""

        def accept_client(raw: socket.socket) -> None:
            self._accept_client(raw, handshake, ssl)

        remaining = list(sockets)
        made: list[Acceptor] = []
        try:
            while remaining:
                made.append(Acceptor(remaining[0], accept_client, self.limited_log))
                remaining.pop(0)
        except OSError:
            for acceptor in made:
                acceptor.close()
            for one in remaining:
                release_socket(one)
            raise
        self._acceptors.extend(made)

    def _accept_client(self, raw: socket.socket, handshake: HandshakeFactory, ssl: SSLContext | None) -> None:
        """Begin or refuse the connection of a client."""
        if ssl is not None:
            if len(self.unauthenticated) >= MAX_UNAUTHENTICATED:
                self._refuse_client(
                    raw, HandshakeRefusal(b"", f"{MAX_UNAUTHENTICATED} others have not shown a token yet")
                )
                return
            self.unauthenticated.add(raw)
        elif self._clients >= self.max_clients:
            self._refuse_client(raw, self._too_many_clients())
            return
        unread = UnreadInput(partial(unread_size, raw))
        self._unread[unread] = None
        task = self._loop.create_task(self._begin_connection(raw, unread, handshake, ssl))
        self._arriving.add(task)
        self._expected.add(raw)

        def arrived(done: asyncio.Task[bool]) -> None:
            self._arriving.discard(done)
            self._expected.discard(raw)
            if done.cancelled():
                raw.close()
            if done.cancelled() or not done.result():
                self.unauthenticated.discard(raw)
                self._unread.pop(unread, None)

        task.add_done_callback(arrived)

    async def _begin_connection(
        self, raw: socket.socket, unread: UnreadInput, handshake: HandshakeFactory, ssl: SSLContext | None
    ) -> bool:
        """Begin a connection.  Returns False if that failed."""
        try:
            if raw.family in (socket.AF_INET, socket.AF_INET6):
                raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                for level, option, value in KEEP_ALIVE:
                    raw.setsockopt(level, option, value)
            connection = LobbyConnection(self, raw, unread, handshake, ssl is not None)
            # When TLS fails, asyncio closes the socket without an answer.
            spare = None if ssl is None else raw.dup()
        except OSError:  # the client is gone, or there is no descriptor left
            raw.close()
            return False
        timeout = TLS_TIMEOUT_S if ssl is not None else None
        try:
            await self._loop.connect_accepted_socket(
                lambda: connection, raw, ssl=ssl, ssl_handshake_timeout=timeout
            )
        except OSError as error:
            if spare is not None:
                text = f"client {connection.peer} refused: it speaks no TLS, which this address wants"
                self.limited_log.say("clients refused: no TLS", text)
                if isinstance(error, ConnectionAbortedError) or getattr(error, "reason", "") in _PLAIN:
                    _send_refusal(spare, WANTS_TLS)
            return False
        finally:
            if spare is not None:
                spare.close()
        return True

    def _too_many_clients(self) -> HandshakeRefusal:
        most = self.max_clients
        told = line(f"too many connections ({most}); close one, or raise max_clients")
        return HandshakeRefusal(told, f"too many connections ({most})")

    def add_connection(self, connection: LobbyConnection) -> None:
        """Add a connection that has begun."""
        self._expected.discard(connection.raw)
        self.connections[connection] = None

    def admit_authenticated(self, connection: LobbyConnection) -> bool:
        """Count an authenticated TLS connection as a client.  Refuses it and returns False if there are too many."""
        self.unauthenticated.discard(connection.raw)
        if self._clients > self.max_clients:
            connection.refuse(self._too_many_clients())
            return False
        return True

    @property
    def _clients(self) -> int:
        return len(self.connections) + len(self._expected) - len(self.unauthenticated)

    def _refuse_client(self, raw: socket.socket, refusal: HandshakeRefusal) -> None:
        self.limited_log.say(
            f"clients refused: {refusal.reason}", f"client {peer_of(raw)[1]} refused: {refusal.reason}"
        )
        with raw:
            raw.setblocking(False)
            if refusal.answer:
                _send_refusal(raw, refusal.answer)

    # ---------------------------------------------------------------- connections

    def disconnect_watcher(self) -> DisconnectWatcher:
        """The watcher of connections that are not being read.  Raises OSError when there is no descriptor left for
        it."""
        if self._disconnect_watcher is None:
            self._disconnect_watcher = DisconnectWatcher()
        return self._disconnect_watcher

    def remove_connection(self, connection: LobbyConnection) -> None:
        """Remove a connection that has ended."""
        self.connections.pop(connection, None)
        self._unread.pop(connection.unread, None)
        self.unauthenticated.discard(connection.raw)
        self.paused.pop(connection, None)
        for acceptor in self._acceptors:
            self._loop.call_soon(acceptor.resume_accepting)

    def pending(self, connection: LobbyConnection) -> Callable[[Lobby], None]:
        """The callback for the first output of a lobby in a round."""

        def wanted(lobby: Lobby) -> None:
            self._dirty[connection] = None

        return wanted

    def _end_era(self) -> None:
        """What has been sent until now belongs to the era that ends, also by clients that wait to be accepted."""
        for acceptor in self._acceptors:
            acceptor.accept_waiting()
        for unread in self._unread:
            unread.end_era(self.driver.scheduler.era)

    def _round_over(self) -> None:
        while self._dirty:
            connection, _ = self._dirty.popitem()
            connection.flush()
        if self.paused:
            for connection in list(self.paused):
                connection.resume_reading_if_drained()

    async def close(self) -> None:
        """Stop listening, send the remaining output, and close all connections."""
        for acceptor in self._acceptors:
            acceptor.close()
        for task in self._arriving:
            task.cancel()
        self._round_over()
        for connection in list(self.connections):
            connection.close()
        await asyncio.sleep(0)
        self.limited_log.close()
        if self._disconnect_watcher is not None:
            self._disconnect_watcher.close()
            self._disconnect_watcher = None


def _send_refusal(raw: socket.socket, text: bytes) -> None:
    """Send the answer to a refused client, if that is possible without waiting."""
    with contextlib.suppress(OSError):
        raw.send(text)
        raw.shutdown(socket.SHUT_WR)
