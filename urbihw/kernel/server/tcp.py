"""Move bytes between clients and their lobbies, over TCP and UNIX sockets.

Each connection has TCP_NODELAY set, and what a lobby says in one scheduler round leaves in one write.  Nobody pays for
a client but itself: what it is not read of is bounded (``Output``), what it sends ahead is, and so is how many there
are.  What a client sends is evaluated once its ``Greeting`` has accepted the first bytes.

A client may end its sending side, as ``printf ... | nc`` does: what it sent is run to its end in the foreground and
answered, then the connection is closed.  A client that is gone as a whole is told from that by ``departures``.
"""

from __future__ import annotations

import asyncio
import logging
import math
import socket
import struct
from collections.abc import Callable, Iterable
from pathlib import Path
from ssl import SSLContext
from typing import Final

from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.server.departures import Departures, knock
from urbihw.kernel.server.doors import Door, bind, bind_unix, let_go
from urbihw.kernel.server.greeting import FirstBytes, Greeter, Greeting, Refusal, line
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
MOST_AHEAD: Final = 1024 * 1024
"""Bytes that a client may send ahead of what is run; then it is not read from until half of them are."""
HANDSHAKE: Final = 10.0
"""Seconds that TLS may take to begin."""
LINGER: Final = 1.0
"""Seconds in which a client that was refused may take the answer; what it sends meanwhile is thrown away."""
LAST_WORDS: Final = 10.0
"""Seconds in which a client may take what was said before its connection was closed."""
AFTER_INPUT: Final = 600.0
"""Seconds that statements may go on whose client has ended its sending side: at the end of a tunnel, a client that was
killed looks the same."""


class Connection(asyncio.Protocol):
    """One client.

    Attributes:
        address: of the client; None for a UNIX socket.
        peer: what the client is called in the log.
        raw: its socket.
        greeting: what decides, or has decided, to let it in.
        lobby: its lobby, while there is one.
    """

    def __init__(self, server: Server, raw: socket.socket, greeting: Greeter, secure: bool) -> None:
        self._server = server
        self.raw = raw
        self._secure = secure
        self._transport: asyncio.Transport
        self._loop = asyncio.get_running_loop()
        self._timers: list[asyncio.TimerHandle] = []
        self.address, self.peer = _peer(raw)
        self.greeting: Greeting = greeting(self.address or "")
        self._undecided = True
        self._refused = False
        self._open = False
        self._paused = False
        self._ended = False
        self.lobby: Lobby | None = None

    # ---------------------------------------------------------------- the first bytes

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A client is there: give it a lobby and the banner, or wait for its first bytes."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._open = True
        self._server.entered(self)
        if self.greeting.welcome_first:
            self._welcome()
        if self.greeting.patience != math.inf:
            self._later(self.greeting.patience, self._too_late)

    def _welcome(self) -> None:
        server = self._server
        lobby = server.open_lobby(self.address, server.pending(self), server.limit)
        self._transport.set_write_buffer_limits(lobby.output.low, lobby.output.low)
        lobby.user = self.greeting.user
        lobby.on_quit = self._quit
        lobby.output.unread = self._transport.get_write_buffer_size
        lobby.output.give_up = self._does_not_read
        self.lobby = lobby
        server.driver.drive()

    def _accepted(self, data: bytes) -> bytes | None:
        """What of the first bytes goes to the lobby, if they are accepted; there is a lobby then."""
        if self._refused:
            return None
        try:
            accepted = self.greeting.take(data)
        except Refusal as refusal:
            self.refuse(refusal)
            return None
        if accepted is not None:
            self._undecided = False
            if self.raw in self._server.strangers and not self._server.introduced(self):
                return None
            if self.greeting.user:
                self.peer += f" ({self.greeting.user})"
            if self.greeting.answer:
                self._transport.write(self.greeting.answer)
            if self.lobby is None:
                self._welcome()
        return accepted

    def _too_late(self) -> None:
        if self._undecided and not self._refused:
            self.refuse(Refusal(line("nothing came in time"), "it did not say in time who it is"))

    def refuse(self, refusal: Refusal) -> None:
        """Let the client do nothing more, and close the connection; also one that had been let in."""
        if self._refused or self._transport.is_closing():
            return
        reason = refusal.reason
        self._server.thinned.warning(f"clients refused: {reason}", f"client {self.peer} refused: {reason}")
        self._refused = True
        self._close_lobby()
        if refusal.delay:
            self._later(refusal.delay, self._dismiss, refusal.answer)
        else:
            self._dismiss(refusal.answer)

    def _dismiss(self, answer: bytes) -> None:
        """Send the answer and close.  Closing with unread bytes would be a reset, which may overtake the answer."""
        if self._transport.is_closing():
            return
        self._transport.write(answer)
        if self._transport.can_write_eof():
            self._transport.write_eof()
        else:
            self._transport.close()
        # Who neither reads nor closes: TLS would wait for its last word.
        self._later(LINGER, self._transport.abort)

    # ---------------------------------------------------------------- what the client sends

    def data_received(self, data: bytes) -> None:
        """Bytes from the client."""
        if self._undecided:
            accepted = self._accepted(data)
            if accepted is None:
                return
            data = accepted
        if self.lobby is not None:
            self.lobby.feed(data)
            self._server.driver.drive()
            if self.lobby.shell.waiting > MOST_AHEAD:
                self._pause()

    def _pause(self) -> None:
        """Read no more until what was sent ahead is run; the end of the client is noticed nevertheless."""
        if self._paused or self._transport.is_closing() or not self._watch(self._input_ended):
            return
        self._paused = True
        self._transport.pause_reading()
        self._server.paused[self] = None

    def read_on(self) -> None:
        """Read again if enough was run meanwhile."""
        if self.lobby is None or self.lobby.shell.waiting <= MOST_AHEAD // 2:
            self._paused = False
            del self._server.paused[self]
            self._server.departures().forget(self.raw.fileno())
            self._transport.resume_reading()

    def eof_received(self) -> bool:
        """The client sends no more: answer what it sent, if there is somebody to answer to."""
        if self._undecided:
            # What was held back can become no other protocol's first line any more.
            self.data_received(b"\n")
        # TLS knows no half-closed connections.
        if self.lobby is None or self._secure or self._refused or not self._watch(None):
            return False
        self._input_ended()
        self._later(AFTER_INPUT, self._say_goodbye)
        self.lobby.end_of_input(lambda: self._later(0, self._say_goodbye))
        self._server.driver.drive()
        return True

    def _input_ended(self) -> None:
        """The client has ended its sending side, or it is gone: that will be known now."""
        if not self._ended:
            self._ended = True
            knock(self.raw)
        if self.lobby is not None:
            self.lobby.lose_command()
            self._server.driver.drive()

    def _say_goodbye(self) -> None:
        if self.lobby is not None:
            self.lobby.quit()

    def _watch(self, ended: Callable[[], None] | None) -> bool:
        """Notice the end of the client although nothing is read; False if that cannot be."""
        try:
            self._server.departures().watch(self.raw.fileno(), self._transport.abort, ended)
        except OSError:
            return False
        return True

    def connection_lost(self, error: Exception | None) -> None:
        """The client is gone."""
        self._open = False
        self._server.left(self)
        if self._paused or self._ended:
            self._server.departures().forget(self.raw.fileno())
        for timer in self._timers:
            timer.cancel()
        if isinstance(error, TimeoutError):
            self._server.thinned.warning(
                "clients that neither answer nor read", f"client {self.peer} neither answers nor reads: closed"
            )
        self._close_lobby()

    def _close_lobby(self) -> None:
        lobby, self.lobby = self.lobby, None
        if lobby is not None:
            lobby.close()
            self._server.driver.drive()

    # ---------------------------------------------------------------- what the lobby says

    def flush(self) -> None:
        """Send what the lobby said."""
        if self.lobby is None or self._transport.is_closing():
            return
        output = self.lobby.output
        data = output.take()
        if data:
            self._transport.write(data)
        output.handed_on()

    def resume_writing(self) -> None:
        """The client has read: there is room for more."""
        if self.lobby is not None:
            self.lobby.output.handed_on()
            self._server.driver.drive()

    def _does_not_read(self, unread: int) -> None:
        log.warning("client %s does not read: closed with %d unread bytes", self.peer, unread)
        self._transport.abort()

    def _quit(self) -> None:
        self.flush()
        self._transport.close()
        self._later(LAST_WORDS, self._transport.abort)

    def close(self) -> None:
        """Send what there is and close."""
        self._quit()

    def _later(self, seconds: float, action: Callable[..., None], *arguments: object) -> None:
        """Do something, unless the connection is over by then."""
        if self._open:
            self._timers.append(self._loop.call_later(seconds, action, *arguments))


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
        except OSError:  # gone already
            raw.close()
            return False
        patience = HANDSHAKE if ssl is not None else None
        try:
            await self._loop.connect_accepted_socket(
                lambda: connection, raw, ssl=ssl, ssl_handshake_timeout=patience
            )
        except OSError:
            if ssl is not None:
                text = f"client {connection.peer} refused: it speaks no TLS, which this address wants"
                self.thinned.warning("clients refused: no TLS", text)
            return False
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
            f"clients refused: {refusal.reason}", f"client {_peer(raw)[1]} refused: {refusal.reason}"
        )
        with raw:
            raw.setblocking(False)
            if refusal.answer:
                try:
                    raw.send(refusal.answer)
                    raw.shutdown(socket.SHUT_WR)
                except OSError:
                    return

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


def _peer(raw: socket.socket) -> tuple[str | None, str]:
    """The address of a client, None for a UNIX socket, and what it is called in the log."""
    if raw.family == socket.AF_UNIX:
        process, user, _ = struct.unpack("3i", raw.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
        return None, f"process {process} of user {user}"
    try:
        host, port = raw.getpeername()[:2]
    except OSError:  # gone already
        return "?", "?"
    return host, f"{host}:{port}"
