"""TCP and serial connections for ``network``, without urbiscript and without the scheduler.

The thread of the ``poller`` reads and writes for all connections of a kernel without blocking.  Received bytes are kept
with the connection, up to ``MAX_UNHANDLED_SIZE``, and ``news`` is called once when there are some; until they are
handled, nothing more is read, and the other side waits.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import threading
from collections import deque
from collections.abc import Callable
from typing import Final

from urbihw.frozen import frozen
from urbihw.kernel.runtime.holdings import Address
from urbihw.kernel.stdlib.poller import LATER, NOTHING, OVER, READ, WRITE, Poller

CHUNK_SIZE: Final = 65536
"""Number of bytes that are read, written or handled in one step."""
MAX_CHUNKS_PER_TURN: Final = 16
"""Number of pieces that are written before other connections get their turn."""
MAX_UNHANDLED_SIZE: Final = 1024 * 1024
"""Maximum number of received and unhandled bytes per connection; one more ``CHUNK_SIZE`` is possible."""
MAX_PENDING_CONNECTIONS: Final = 16
"""Maximum number of accepted connections that a Server has not handled yet."""
RESOURCE_ERRORS: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
"""Errors of the operating system that are not caused by the connecting peer."""


@frozen(slots=False)
class SocketStream:
    """An open non-blocking descriptor, and the addresses of both ends."""

    descriptor: int
    remote: Address
    local: Address

    def close(self) -> None:
        """Close the descriptor, unless it is already in use."""
        os.close(self.descriptor)


def tcp_stream(connection: socket.socket) -> SocketStream:
    """The stream of a TCP connection, which takes over the descriptor.  Raises OSError."""
    remote, local = connection.getpeername()[:2], connection.getsockname()[:2]
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setblocking(False)
    return SocketStream(connection.detach(), remote, local)


def serial_stream(device: str, baud: int) -> SocketStream:
    """A serial port with eight bits and no parity, opened by the operating system's interface: a bus library is not
    needed for it.

    Raises OSError.
    """
    import termios
    import tty

    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        raise OSError(f"the system knows no speed of {baud} baud")
    opened = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        tty.setraw(opened)
        modes = termios.tcgetattr(opened)
        modes[4] = modes[5] = speed
        termios.tcsetattr(opened, termios.TCSANOW, modes)
    except (OSError, termios.error) as error:
        os.close(opened)
        raise OSError(f"{device} is no serial port: {error}") from error
    return SocketStream(opened, (device, 0), (device, 0))


class ConnectionAttempt:
    """An attempt to connect, in a thread."""

    def __init__(self) -> None:
        self.socket: socket.socket | None = None
        self.local: Address | None = None

    def address(self) -> Address | None:
        """The local address, from any thread; it is known before the other side gets the connection."""
        if self.local is None and self.socket is not None:
            with contextlib.suppress(OSError):  # connected or given up meanwhile
                found: Address = self.socket.getsockname()[:2]
                return found
        return self.local


def connect_to(host: str, port: int | str, attempt: ConnectionAttempt, timeout: float = 30.0) -> SocketStream:
    """Connect to a host.  Blocks; raises OSError."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    problem: OSError | None = None
    for family, kind, protocol, _, address in found:
        made = socket.socket(family, kind, protocol)
        try:
            attempt.socket = made
            made.settimeout(timeout)
            made.connect(address)
            attempt.local = made.getsockname()[:2]
            return tcp_stream(made)
        except OSError as error:
            made.close()
            problem = error
    raise problem if problem is not None else OSError(f"no address for {host}")


class SocketChannel:
    """A stream with its received, unhandled bytes and its unsent bytes.

    ``news()`` is called, from any thread, when ``take_received`` has new bytes after it had none, and when the stream
    is closed.

    Attributes:
        stream: the underlying stream.
        descriptor: descriptor of the stream; -1 when it is closed.
        unsent: number of bytes that wait to be sent.
        over: whether the stream is closed.
        message: reason of the failure; empty after an orderly end.
    """

    def __init__(self, poller: Poller, stream: SocketStream, news: Callable[[], None]) -> None:
        self.stream = stream
        self.descriptor = stream.descriptor
        self.unsent = 0
        self.over = False
        self.message = ""
        self._poller = poller
        self._news = news
        self._lock = threading.Lock()
        self._started = False
        self._ended = False
        """Whether the other side has ended the stream."""
        self._closing = False
        """Whether to close the stream after all data is sent."""
        self._received = bytearray()
        self._unhandled = 0
        """Number of bytes read and not ``handled``, including the taken ones."""
        self._pieces: deque[tuple[memoryview, Callable[[], None] | None]] = deque()

    # ---------------------------------------------------------------- from the kernel's thread

    def start(self) -> None:
        """Start to read and to write."""
        self._started = True
        self._poller.schedule(self)

    def take_received(self) -> bytes:
        """Return and remove the next received bytes; empty if there are none."""
        with self._lock:
            data = bytes(self._received[:CHUNK_SIZE])
            del self._received[:CHUNK_SIZE]
            return data

    @property
    def has_received(self) -> bool:
        """Whether ``take_received`` has bytes."""
        return bool(self._received)

    def count_handled(self, size: int) -> None:
        """Count this number of taken bytes as handled."""
        with self._lock:
            full = self._unhandled >= MAX_UNHANDLED_SIZE
            self._unhandled -= size
            if full and self._unhandled < MAX_UNHANDLED_SIZE:
                self._poller.schedule(self)

    def send(self, data: bytes, sent: Callable[[], None] | None = None) -> None:
        """Queue bytes for sending.  ``sent()`` is then called, from any thread, whether the transmission succeeded or
        not.
        """
        with self._lock:
            first = not self._pieces
            if data and not self._closing:
                self._pieces.append((memoryview(data), sent))
                self.unsent += len(data)
            elif sent is not None:
                sent()
            if first and self._started and len(data) <= CHUNK_SIZE:
                self._write()
            if first and self._pieces:
                self._poller.schedule(self)

    def close(self) -> None:
        """Close after all data is sent."""
        self._closing = True
        self._poller.schedule(self)

    def abort(self) -> None:
        """Close the connection at once."""
        with self._lock:
            self._discard_unsent()
        self.close()

    # ---------------------------------------------------------------- from the thread that waits

    def ready(self) -> int:
        """Do what is possible without blocking; returns the event to wait for."""
        with self._lock:
            if self.over:
                return OVER
            if self._started:
                self._write()
                if self._has_room():
                    self._read()
            if self._closing and not self._pieces:
                self.over = True
                self._news()
                return OVER
            if not self._started:
                return NOTHING
            return (READ if self._has_room() else NOTHING) | (WRITE if self._pieces else NOTHING)

    # ---------------------------------------------------------------- with the lock

    def _has_room(self) -> bool:
        return self._unhandled < MAX_UNHANDLED_SIZE and not self._ended

    def _read(self) -> None:
        try:
            data = os.read(self.descriptor, CHUNK_SIZE)
        except BlockingIOError:
            return
        except OSError as error:
            self.message = "" if self._closing else error.strerror or str(error)
            self._discard_unsent()
            data = b""
        if not data:
            self._ended = self._closing = True
            return
        first = not self._received
        self._received += data
        self._unhandled += len(data)
        if first:
            self._news()

    def _write(self) -> None:
        for _ in range(MAX_CHUNKS_PER_TURN):
            if not self._pieces:
                return
            data, sent = self._pieces[0]
            try:
                size = os.write(self.descriptor, data[:CHUNK_SIZE])
            except BlockingIOError:
                return
            except OSError:
                self._discard_unsent()  # reading reports the reason
                return
            self.unsent -= size
            if size < len(data):
                self._pieces[0] = data[size:], sent
                return
            self._pieces.popleft()
            if sent is not None:
                sent()

    def _discard_unsent(self) -> None:
        """Discard the unsent bytes."""
        pieces, self._pieces, self.unsent = self._pieces, deque(), 0
        for _, sent in pieces:
            if sent is not None:
                sent()


class SocketListener:
    """A listening socket.  ``accepted(stream)`` is called from the poller's thread; ``count_accepted`` must be called
    after the stream is handled."""

    def __init__(self, poller: Poller, host: str, port: int | str) -> None:
        """The lookup of the host may take long.  Raises OSError."""
        family, kind, protocol, _, address = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        self._poller = poller
        self._lock = threading.Lock()
        self._waiting = 0
        self._accepted: Callable[[SocketStream], None]
        self._socket = socket.socket(family, kind, protocol)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind(address)
            self._socket.listen()
            self._socket.setblocking(False)
        except OSError:
            self._socket.close()
            raise
        self.host, self.port = self._socket.getsockname()[:2]
        self.descriptor = self._socket.fileno()
        self.is_open = True

    def start(self, accepted: Callable[[SocketStream], None]) -> None:
        """Start to accept connections."""
        self._accepted = accepted
        self._poller.schedule(self)

    def ready(self) -> int:
        """Accept one connection; returns the event to wait for."""
        with self._lock:
            if not self.is_open:
                self._socket.detach()  # the thread closes it
                return OVER
            if self._waiting >= MAX_PENDING_CONNECTIONS:
                return NOTHING
        try:
            made = tcp_stream(self._socket.accept()[0])
        except OSError as error:  # no free descriptor, or the peer has closed the connection, or there is none
            return LATER if error.errno in RESOURCE_ERRORS else READ
        with self._lock:
            self._waiting += 1
            self._accepted(made)
        return READ

    def count_accepted(self) -> None:
        """Count an accepted connection as handled."""
        with self._lock:
            full = self._waiting >= MAX_PENDING_CONNECTIONS
            self._waiting -= 1
        if full:
            self._poller.schedule(self)

    def close(self) -> None:
        """Stop listening; a second call has no effect."""
        with self._lock:
            if self.is_open:
                self.is_open = False
                with contextlib.suppress(OSError):
                    self._socket.shutdown(socket.SHUT_RDWR)  # from now on, others may listen on the port
                self._poller.schedule(self)
