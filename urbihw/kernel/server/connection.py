"""One client: between its socket and its lobby.

What the client sends is evaluated once its ``Greeting`` has accepted the first bytes.  Nobody pays for a client but
itself: what it is not read of is bounded (``Output``), and so is what it sends ahead.

A client may end its sending side, as ``printf ... | nc`` does: what it sent is run to its end in the foreground and
answered, then the connection is closed.  A client that is gone as a whole is told from that by ``departures``.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import socket
import struct
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.server.departures import knock
from urbihw.kernel.server.greeting import Greeter, Greeting, Refusal, line

if TYPE_CHECKING:
    from urbihw.kernel.server.tcp import Server

log = logging.getLogger("urbihw.server")

MOST_AHEAD: Final = 1024 * 1024
"""Bytes that a client may send ahead of what is run; then it is not read from until half of them are."""
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
        self.address, self.peer = peer_of(raw)
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
        if self.address is not None:
            with contextlib.suppress(OSError):  # gone already
                lobby.came_from(self.raw.getpeername()[:2])
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


def peer_of(raw: socket.socket) -> tuple[str | None, str]:
    """The address of a client, None for a UNIX socket, and what it is called in the log."""
    if raw.family == socket.AF_UNIX:
        process, user, _ = struct.unpack("3i", raw.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
        return None, f"process {process} of user {user}"
    try:
        host, port = raw.getpeername()[:2]
    except OSError:  # gone already
        return "?", "?"
    return host, f"{host}:{port}"
