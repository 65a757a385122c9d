"""The connection of one client: moves bytes between its socket and its lobby.

Input is evaluated once the ``Handshake`` has accepted the first bytes.  A slow or fast client costs the other clients
nothing: both its unread output (``Output``) and its pending input are bounded.

A client may close its sending side only, as ``printf ... | nc`` does: its input is run to the end in the foreground and
answered, then the connection is closed.  ``disconnects`` tells this from a client that is gone.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import logging
import math
import socket
import struct
import termios
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.arrivals import UnreadInput
from urbihw.kernel.server.disconnects import send_probe_byte
from urbihw.kernel.server.handshake import Handshake, HandshakeFactory, HandshakeRefusal, line

if TYPE_CHECKING:
    from urbihw.kernel.server.tcp import Server

log = logging.getLogger("urbihw.server")

MAX_PENDING_INPUT: Final = 1024 * 1024
"""Maximum number of received bytes that wait to be run.  Beyond it, reading pauses until half of them have run."""
REFUSAL_TIMEOUT_S: Final = 1.0
"""Seconds in which a refused client can receive the answer.  Its input during this time is discarded."""
FLUSH_TIMEOUT_S: Final = 10.0
"""Seconds in which a client can receive the remaining output after its connection was closed."""
HALF_CLOSED_TIMEOUT_S: Final = 600.0
"""Seconds for which statements go on after the client has closed its sending side.  Through a tunnel, a killed client
looks the same."""


class LobbyConnection(asyncio.Protocol):
    """The connection of one client.

    Attributes:
        address: the client's address; None for a UNIX socket.
        peer: the client's name in the log.
        raw: the client's socket.
        unread: what has arrived there and is not read.
        handshake: decides from the first bytes whether the client is accepted.
        lobby: the client's lobby; None before it is accepted and after the connection is closed.
    """

    def __init__(
        self, server: Server, raw: socket.socket, unread: UnreadInput, handshake: HandshakeFactory, secure: bool
    ) -> None:
        self._server = server
        self.raw = raw
        self.unread = unread
        self._secure = secure
        self._transport: asyncio.Transport
        self._loop = asyncio.get_running_loop()
        self._timers: list[asyncio.TimerHandle] = []
        self.address, self.peer = peer_of(raw)
        self.handshake: Handshake = handshake(self.address or "")
        self._undecided = True
        self._refused = False
        self._open = False
        self._ended = False
        self.lobby: Lobby | None = None

    # ---------------------------------------------------------------- the first bytes

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The client has connected: open its lobby and send the banner, or wait for its first bytes."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._open = True
        self._server.add_connection(self)
        if self.handshake.welcome_first:
            self._open_lobby()
        if self.handshake.timeout != math.inf:
            self._later(self.handshake.timeout, self._too_late)

    def _open_lobby(self) -> None:
        server = self._server
        lobby = server.open_lobby(self.address, server.pending(self), server.limit)
        self._transport.set_write_buffer_limits(lobby.output.low_mark, lobby.output.low_mark)
        if self.address is not None:
            with contextlib.suppress(OSError):  # gone already
                lobby.find_maker(self.raw.getpeername()[:2])
        lobby.user = self.handshake.user
        lobby.on_quit = self._quit
        lobby.unread = self.unread
        lobby.output.unread = self._transport.get_write_buffer_size
        lobby.output.give_up = self._does_not_read
        self.lobby = lobby
        server.driver.drive()

    def _accepted(self, data: bytes) -> bytes | None:
        """The part of the first bytes that belongs to the lobby, which is open then; None while they are not
        accepted."""
        if self._refused:
            return None
        try:
            accepted = self.handshake.check_bytes(data)
        except HandshakeRefusal as refusal:
            self.refuse(refusal)
            return None
        if accepted is not None:
            self._undecided = False
            if self.raw in self._server.unauthenticated and not self._server.admit_authenticated(self):
                return None
            if self.handshake.user:
                self.peer += f" ({self.handshake.user})"
            if self.handshake.answer:
                self._transport.write(self.handshake.answer)
            if self.lobby is None:
                self._open_lobby()
        return accepted

    def _too_late(self) -> None:
        if self._undecided and not self._refused:
            self.refuse(HandshakeRefusal(line("nothing came in time"), "it did not say in time who it is"))

    def refuse(self, refusal: HandshakeRefusal) -> None:
        """Stop evaluating the client's input, answer, and close the connection.  The client may have been accepted
        before."""
        if self._refused or self._transport.is_closing():
            return
        reason = refusal.reason
        self._server.limited_log.say(f"clients refused: {reason}", f"client {self.peer} refused: {reason}")
        self._refused = True
        self._close_lobby()
        if refusal.delay:
            self._later(refusal.delay, self._answer_and_close, refusal.answer)
        else:
            self._answer_and_close(refusal.answer)

    def _answer_and_close(self, answer: bytes) -> None:
        """Send the answer, then close.  To close with unread input would send a reset, which may overtake the
        answer."""
        if self._transport.is_closing():
            return
        self._transport.write(answer)
        if self._transport.can_write_eof():
            self._transport.write_eof()
        else:
            self._transport.close()
        # The client may neither read nor close; TLS would wait for its close_notify.
        self._later(REFUSAL_TIMEOUT_S, self._transport.abort)

    # ---------------------------------------------------------------- what the client sends

    def data_received(self, data: bytes) -> None:
        """Handle bytes from the client."""
        if self._undecided:
            accepted = self._accepted(data)
            if accepted is None:
                return
            data = accepted
        if self.lobby is not None:
            if self._server.overheard is not None:
                self._server.overheard(self, ">", data)
            self.lobby.feed(data)
            self._server.driver.drive()
            if self.lobby.shell.waiting > MAX_PENDING_INPUT:
                self._pause()

    def _pause(self) -> None:
        """Pause reading until the pending input has run.  A disconnect is noticed nevertheless."""
        if self.unread.paused or self._transport.is_closing() or not self._watch(self._input_ended):
            return
        self.unread.pause()
        self._transport.pause_reading()
        self._server.paused[self] = None

    def resume_reading_if_drained(self) -> None:
        """Resume reading if enough of the pending input has run."""
        if self.lobby is None or self.lobby.shell.waiting <= MAX_PENDING_INPUT // 2:
            self.unread.resume()
            del self._server.paused[self]
            self._server.disconnect_watcher().unwatch(self.raw.fileno())
            self._transport.resume_reading()

    def eof_received(self) -> bool:
        """The client has closed its sending side: run and answer its input if the client is still there."""
        if self._undecided:
            # The bytes held back cannot become the first line of another protocol any more.
            self.data_received(b"\n")
        # TLS has no half-closed connections.
        if self.lobby is None or self._secure or self._refused or not self._watch(None):
            return False
        self._input_ended()
        self._later(HALF_CLOSED_TIMEOUT_S, self._quit_lobby)
        self.lobby.end_of_input(lambda: self._later(0, self._quit_lobby))
        self._server.driver.drive()
        return True

    def _input_ended(self) -> None:
        """The client has closed its sending side, or it is gone: find out which."""
        if not self._ended:
            self._ended = True
            send_probe_byte(self.raw)
        if self.lobby is not None:
            self.lobby.revoke_command()
            self._server.driver.drive()

    def _quit_lobby(self) -> None:
        if self.lobby is not None:
            self.lobby.quit()

    def _watch(self, ended: Callable[[], None] | None) -> bool:
        """Watch for a disconnect although nothing is read; False if that is impossible."""
        try:
            self._server.disconnect_watcher().watch(self.raw.fileno(), self._transport.abort, ended)
        except OSError:
            return False
        return True

    def connection_lost(self, error: Exception | None) -> None:
        """The connection has ended: end the lobby."""
        self._open = False
        self._server.remove_connection(self)
        if self.unread.paused or self._ended:
            self._server.disconnect_watcher().unwatch(self.raw.fileno())
        for timer in self._timers:
            timer.cancel()
        if isinstance(error, TimeoutError):
            self._server.limited_log.say(
                "clients that neither answer nor read", f"client {self.peer} neither answers nor reads: closed"
            )
        self._close_lobby()

    def _close_lobby(self) -> None:
        lobby, self.lobby = self.lobby, None
        if lobby is not None:
            lobby.close()
            self._server.driver.drive()

    # ---------------------------------------------------------------- output of the lobby

    def flush(self) -> None:
        """Send the output of the lobby."""
        if self.lobby is None or self._transport.is_closing():
            return
        output = self.lobby.output
        data = output.take_bytes()
        if data:
            if self._server.overheard is not None:
                self._server.overheard(self, "<", data)
            self._transport.write(data)
        output.update_unread()

    def resume_writing(self) -> None:
        """The client has read enough: the transport accepts more output."""
        if self.lobby is not None:
            self.lobby.output.update_unread()
            self._server.driver.drive()

    def _does_not_read(self, unread: int) -> None:
        log.warning("client %s does not read: closed with %d unread bytes", self.peer, unread)
        self._transport.abort()

    def _quit(self) -> None:
        self.flush()
        self._transport.close()
        self._later(FLUSH_TIMEOUT_S, self._transport.abort)

    def close(self) -> None:
        """Send the remaining output, then close."""
        self._quit()

    def _later(self, seconds: float, action: Callable[..., None], *arguments: object) -> None:
        """Call ``action`` after some seconds, unless the connection has ended by then."""
        if self._open:
            self._timers.append(self._loop.call_later(seconds, action, *arguments))


def unread_size(raw: socket.socket) -> int:
    """The number of bytes that have arrived at a socket and were not read; 0 if it is closed."""
    try:
        return int(struct.unpack("i", fcntl.ioctl(raw.fileno(), termios.FIONREAD, b"\0" * 4))[0])
    except (OSError, ValueError):
        return 0


def peer_of(raw: socket.socket) -> tuple[str | None, str]:
    """The address of a client (None for a UNIX socket), and its name in the log."""
    if raw.family == socket.AF_UNIX:
        process, user, _ = struct.unpack("3i", raw.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
        return None, f"process {process} of user {user}"
    try:
        host, port = raw.getpeername()[:2]
    except OSError:  # gone already
        return "?", "?"
    return host, f"{host}:{port}"
