"""Connections, for ``network``: no urbiscript here, no scheduler.

The thread of the ``poller`` reads and writes for all connections of a kernel; none of them is ever waited for.  What
comes is kept with the connection, at most ``MOST_READ`` bytes of it, and whoever is to handle it is told once that
there is something (``news``); as long as it is not handled, nothing more is read, and the other side waits.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from urbihw.kernel.runtime.holdings import Address
from urbihw.kernel.stdlib.poller import LATER, NOTHING, OVER, READ, WRITE, Poller

PIECE: Final = 65536
"""Bytes that are read, written or handled in one go."""
TURN: Final = 16
"""Pieces that are written before others have their turn."""
MOST_READ: Final = 1024 * 1024
"""Bytes of one connection that may have been read and not been handled; there may be a ``PIECE`` more."""
MOST_WAITING: Final = 16
"""Connections that may have come to a listener and not been welcomed."""
NO_ROOM: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
"""Errors of the operating system that say nothing about who wants to connect."""


@dataclass(frozen=True)
class Stream:
    """An open descriptor, of which nothing has to be waited for, and the addresses of both sides."""

    descriptor: int
    remote: Address
    local: Address

    def close(self) -> None:
        """Close it, if nobody has begun to use it."""
        os.close(self.descriptor)


def tcp_stream(connection: socket.socket) -> Stream:
    """The stream of a TCP connection, to which the descriptor belongs from then on.  Raises OSError."""
    remote, local = connection.getpeername()[:2], connection.getsockname()[:2]
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setblocking(False)
    return Stream(connection.detach(), remote, local)


def serial_stream(device: str, baud: int) -> Stream:
    """A serial port, eight bits and no parity, as the system has it: no library of buses is needed for so little.

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
    return Stream(opened, (device, 0), (device, 0))


class Trial:
    """A connection that is being made, in a thread."""

    def __init__(self) -> None:
        self.socket: socket.socket | None = None
        self.local: Address | None = None

    def address(self) -> Address | None:
        """Its address, from any thread; the operating system has given it one before the other side hears of it."""
        if self.local is None and self.socket is not None:
            with contextlib.suppress(OSError):  # connected or given up meanwhile
                found: Address = self.socket.getsockname()[:2]
                return found
        return self.local


def dial(host: str, port: int | str, trial: Trial, timeout: float = 30.0) -> Stream:
    """Connect.  Blocks; raises OSError."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    problem: OSError | None = None
    for family, kind, protocol, _, address in found:
        made = socket.socket(family, kind, protocol)
        try:
            trial.socket = made
            made.settimeout(timeout)
            made.connect(address)
            trial.local = made.getsockname()[:2]
            return tcp_stream(made)
        except OSError as error:
            made.close()
            problem = error
    raise problem if problem is not None else OSError(f"no address for {host}")


class Wire:
    """A stream with what was read and not been handled, and with what is to be sent.

    ``news()`` is called, from any thread, when there is something to ``take`` after there was nothing, and when the
    stream is closed.

    Attributes:
        stream: what it reads and writes.
        descriptor: of it; -1 when it is closed.
        unsent: bytes that wait to be sent.
        over: the stream is closed.
        message: why it broke; empty when the end was orderly.
    """

    def __init__(self, poller: Poller, stream: Stream, news: Callable[[], None]) -> None:
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
        """Nothing more comes."""
        self._closing = False
        """To be closed when all is sent."""
        self._untaken = bytearray()
        self._unhandled = 0
        """Bytes read and not ``handled``, the ``taken`` ones too."""
        self._pieces: deque[tuple[memoryview, Callable[[], None] | None]] = deque()

    # ---------------------------------------------------------------- from the kernel's thread

    def start(self) -> None:
        """Begin to read and to write."""
        self._started = True
        self._poller.attend(self)

    def take(self) -> bytes:
        """The next bytes received; empty when there are none."""
        with self._lock:
            data = bytes(self._untaken[:PIECE])
            del self._untaken[:PIECE]
            return data

    @property
    def waiting(self) -> bool:
        """Whether there is something to ``take``."""
        return bool(self._untaken)

    def handled(self, size: int) -> None:
        """So many of the bytes taken were handled."""
        with self._lock:
            full = self._unhandled >= MOST_READ
            self._unhandled -= size
            if full and self._unhandled < MOST_READ:
                self._poller.attend(self)

    def send(self, data: bytes, sent: Callable[[], None] | None = None) -> None:
        """Write bytes when their turn comes; ``sent()`` is called, from any thread, whatever became of them."""
        with self._lock:
            first = not self._pieces
            if data and not self._closing:
                self._pieces.append((memoryview(data), sent))
                self.unsent += len(data)
            elif sent is not None:
                sent()
            if first and self._started and len(data) <= PIECE:
                self._write()
            if first and self._pieces:
                self._poller.attend(self)

    def close(self) -> None:
        """Close when all is sent."""
        self._closing = True
        self._poller.attend(self)

    def abort(self) -> None:
        """Close at once."""
        with self._lock:
            self._forget()
        self.close()

    # ---------------------------------------------------------------- from the thread that waits

    def ready(self) -> int:
        """Do what can be done at once; what to wait for."""
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
        return self._unhandled < MOST_READ and not self._ended

    def _read(self) -> None:
        try:
            data = os.read(self.descriptor, PIECE)
        except BlockingIOError:
            return
        except OSError as error:
            self.message = "" if self._closing else error.strerror or str(error)
            self._forget()
            data = b""
        if not data:
            self._ended = self._closing = True
            return
        first = not self._untaken
        self._untaken += data
        self._unhandled += len(data)
        if first:
            self._news()

    def _write(self) -> None:
        for _ in range(TURN):
            if not self._pieces:
                return
            data, sent = self._pieces[0]
            try:
                size = os.write(self.descriptor, data[:PIECE])
            except BlockingIOError:
                return
            except OSError:
                self._forget()  # reading tells why
                return
            self.unsent -= size
            if size < len(data):
                self._pieces[0] = data[size:], sent
                return
            self._pieces.popleft()
            if sent is not None:
                sent()

    def _forget(self) -> None:
        """Send nothing of what waits."""
        pieces, self._pieces, self.unsent = self._pieces, deque(), 0
        for _, sent in pieces:
            if sent is not None:
                sent()


class Listener:
    """A listening socket; ``accepted(stream)`` is called from the thread that waits, and who has welcomed the stream
    says so by ``welcomed``."""

    def __init__(self, poller: Poller, host: str, port: int | str) -> None:
        """Looking up the host may take long.  Raises OSError."""
        family, kind, protocol, _, address = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        self._poller = poller
        self._lock = threading.Lock()
        self._waiting = 0
        self._accepted: Callable[[Stream], None]
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

    def start(self, accepted: Callable[[Stream], None]) -> None:
        """Begin to accept."""
        self._accepted = accepted
        self._poller.attend(self)

    def ready(self) -> int:
        """Accept one; what to wait for."""
        with self._lock:
            if not self.is_open:
                self._socket.detach()  # the thread closes it
                return OVER
            if self._waiting >= MOST_WAITING:
                return NOTHING
        try:
            made = tcp_stream(self._socket.accept()[0])
        except OSError as error:  # there is no room, or who came is gone again, or nobody came
            return LATER if error.errno in NO_ROOM else READ
        with self._lock:
            self._waiting += 1
            self._accepted(made)
        return READ

    def welcomed(self) -> None:
        """One of those accepted is handled."""
        with self._lock:
            full = self._waiting >= MOST_WAITING
            self._waiting -= 1
        if full:
            self._poller.attend(self)

    def close(self) -> None:
        """Listen no more; twice is harmless."""
        with self._lock:
            if self.is_open:
                self.is_open = False
                with contextlib.suppress(OSError):
                    self._socket.shutdown(socket.SHUT_RDWR)  # from now on, others may listen to the port
                self._poller.attend(self)
