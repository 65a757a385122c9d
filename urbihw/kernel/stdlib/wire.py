"""Connections in threads, for ``network``: no urbiscript here, no scheduler; whatever happens is told by calls from a
thread, which the owner hands on.
"""

from __future__ import annotations

import os
import queue
import select
import socket
import threading
from collections.abc import Callable
from typing import Protocol


class Stream(Protocol):
    """Something to read from and to write to; both may block."""

    def read(self) -> bytes:
        """What comes next; empty when the other side has closed."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes, all of them."""
        ...

    def close(self) -> None:
        """Close it; a reader that waits comes back."""
        ...


class TcpStream:
    """A TCP connection."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self.remote: tuple[str, int] = connection.getpeername()[:2]
        self.local: tuple[str, int] = connection.getsockname()[:2]

    def read(self) -> bytes:
        """What comes next."""
        return self._socket.recv(65536)

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self._socket.sendall(data)

    def close(self) -> None:
        """Close the connection."""
        try:
            self._socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass  # the other side was quicker
        self._socket.close()


class SerialStream:
    """A serial port, eight bits and no parity, as the system has it: no library of buses is needed for so little."""

    def __init__(self, device: str, baud: int) -> None:
        import termios
        import tty

        speed = getattr(termios, f"B{baud}", None)
        if speed is None:
            raise OSError(f"the system knows no speed of {baud} baud")
        self._file = os.open(device, os.O_RDWR | os.O_NOCTTY)
        try:
            tty.setraw(self._file)
            modes = termios.tcgetattr(self._file)
            modes[4] = modes[5] = speed
            termios.tcsetattr(self._file, termios.TCSANOW, modes)
        except (OSError, termios.error) as error:
            os.close(self._file)
            raise OSError(f"{device} is no serial port: {error}") from error
        self._open = True
        self.remote = (device, 0)
        self.local = (device, 0)

    def read(self) -> bytes:
        """What comes next."""
        while self._open:
            if select.select([self._file], [], [], 0.1)[0]:
                return os.read(self._file, 65536)
        return b""

    def write(self, data: bytes) -> None:
        """Send bytes."""
        while data:
            data = data[os.write(self._file, data) :]

    def close(self) -> None:
        """Close the port."""
        if self._open:
            self._open = False
            os.close(self._file)


LIMIT = 16 * 1024 * 1024
"""How many bytes of one connection may wait, in each direction: for being handled, or for being sent."""


class Wire:
    """A stream with a thread for each direction.

    ``received(data)`` and ``closed(message)`` are called from the reading thread; the message is empty when the end
    was orderly.  ``closed`` is called once.  Who has handled what was received says so by ``taken``: as long as too
    much is not, nothing more is read, and the other side has to wait.
    """

    def __init__(
        self, stream: TcpStream | SerialStream, received: Callable[[bytes], None], closed: Callable[[str], None]
    ) -> None:
        self.stream = stream
        self._received = received
        self._closed = closed
        self._ending = False
        self._room = threading.Condition()
        self._untaken = 0
        self.unsent = 0
        self._pieces: queue.SimpleQueue[tuple[bytes, Callable[[], None] | None]] = queue.SimpleQueue()

    def start(self) -> None:
        """Begin to read and to write."""
        for target in (self._read, self._write):
            threading.Thread(target=target, name="wire", daemon=True).start()

    def send(self, data: bytes, sent: Callable[[], None] | None = None) -> None:
        """Write bytes when their turn comes; ``sent()`` is called from the writing thread, whatever became of them.

        Raises OSError when too much waits already.
        """
        with self._room:
            if self.unsent > LIMIT:
                raise OSError(f"the other side does not read: {self.unsent} bytes wait for it")
            self.unsent += len(data)
        self._pieces.put((data, sent))

    def taken(self, size: int) -> None:
        """So many of the bytes received were handled."""
        with self._room:
            self._untaken -= size
            self._room.notify()

    def close(self) -> None:
        """Close when all is written."""
        self._pieces.put((b"", None))
        with self._room:
            self._untaken = -LIMIT  # nobody waits any more for what is left to be handled
            self._room.notify()

    def _read(self) -> None:
        message = ""
        try:
            data = self.stream.read()
            while data:
                self._received(data)
                self._wait_for_room(len(data))
                data = self.stream.read()
        except (OSError, ValueError) as error:  # ValueError: closed by this side while the reader waits
            message = "" if self._ending else getattr(error, "strerror", None) or str(error)
        self._pieces.put((b"", None))
        self._closed(message)

    def _wait_for_room(self, size: int) -> None:
        with self._room:
            self._untaken += size
            while self._untaken > LIMIT:
                self._room.wait()

    def _write(self) -> None:
        working = True
        while True:
            data, sent = self._pieces.get()
            if not data:
                self._ending = True
                self.stream.close()
                return
            if working:
                try:
                    self.stream.write(data)
                except OSError:
                    working = False  # the reading thread tells
            with self._room:
                self.unsent -= len(data)
            if sent is not None:
                sent()


def dial(host: str, port: int | str, timeout: float = 30.0) -> TcpStream:
    """Connect; raises OSError."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    problem: OSError | None = None
    for family, kind, protocol, _, address in found:
        made = socket.socket(family, kind, protocol)
        try:
            made.settimeout(timeout)
            made.connect(address)
            made.settimeout(None)
            made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return TcpStream(made)
        except OSError as error:
            made.close()
            problem = error
    raise problem if problem is not None else OSError(f"no address for {host}")


class Listener:
    """A listening socket; ``accepted(stream)`` is called from its thread."""

    def __init__(self, host: str, port: int | str, accepted: Callable[[TcpStream], None]) -> None:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        self._socket = socket.socket(family, kind, protocol)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind(address)
            self._socket.listen()
        except OSError:
            self._socket.close()
            raise
        self.host, self.port = self._socket.getsockname()[:2]
        self._accepted = accepted
        threading.Thread(target=self._accept, name="listener", daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._socket.accept()
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                made = TcpStream(connection)
            except OSError:
                if self._socket.fileno() < 0:
                    return
                continue
            self._accepted(made)

    def close(self) -> None:
        """Listen no more."""
        try:
            self._socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass  # some systems refuse it for listening sockets
        self._socket.close()
