"""A listening TCP socket of a worker, looked at once a tick: nothing here waits, and everything is bounded.

A worker must not be held up by who connects: their number, the bytes that are read of each in one look, the messages
that are handled in one look, and the bytes that wait for one that does not read are bounded.
"""

from __future__ import annotations

import contextlib
import socket
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Final

from urbihw.buses.errors import Unavailable

MOST_VISITORS: Final = 16
"""Connections at a time; more are closed at once, unless one of these is idle."""
IDLE_S: Final = 60.0
"""Seconds without a byte after which a visitor gives its place to another one, if there is no other place."""
MOST_ACCEPTED: Final = 4
"""New connections in one look."""
LOST_S: Final = 10.0
"""Seconds in which a visitor must acknowledge what was sent."""
CLOSING_S: Final = 2.0
"""Seconds in which a visitor that is dismissed must have read the rest."""
READ_BYTES: Final = 8192
MOST_READS: Final = 16
"""Reads of one connection in one look, as long as no message is complete."""
MOST_HANDLED: Final = 64
"""Work in one look, of all connections together: 1 for a small message."""
MOST_UNREAD: Final = 1 << 20
"""Bytes that wait for a visitor that does not read; more close the connection."""


class Visitor(ABC):
    """What is said on one connection; no I/O.

    Attributes:
        out: bytes to send.
        closing: nothing more is read, and the connection is closed when ``out`` was sent.
        deadline: when the connection is closed, None for never.
        heard_at: when bytes came last.
    """

    heard_at: float

    def __init__(self, deadline: float | None) -> None:
        self.out = bytearray()
        self.closing = False
        self.deadline = deadline

    def write(self, data: bytes) -> None:
        """Send bytes with the next look; a visitor that does not read is dismissed."""
        if len(self.out) + len(data) > MOST_UNREAD:
            self.out.clear()
            self.closing = True
            return
        self.out += data

    @abstractmethod
    def wants_data(self) -> bool:
        """Whether bytes should be read now."""

    @abstractmethod
    def receive(self, data: bytes) -> None:
        """Handle bytes that have come from the visitor."""

    @abstractmethod
    def work(self, most: int) -> int:
        """Handle messages that have come until they were so much work; return how much, 1 for a small message."""

    @abstractmethod
    def leave(self) -> None:
        """The connection is closed."""


class BusListener:
    """A listening socket and its connections.

    Attributes:
        host, port: where it listens.
    """

    def __init__(self, host: str, port: int, welcome: Callable[[float, str], Visitor]) -> None:
        """``welcome(now, address)`` makes the visitor of a new connection from an address; port 0 finds a free one.

        Raises Unavailable.
        """
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._welcome = welcome
        self._visitors: dict[socket.socket, Visitor] = {}
        self._socket = socket.socket(family, socket.SOCK_STREAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind((host, port))
            self._socket.listen(MOST_VISITORS)
        except OSError as error:
            self._socket.close()
            raise Unavailable(error.errno or 0, f"cannot listen on {host}:{port}: {error.strerror}") from error
        self._socket.setblocking(False)
        self.host = host
        self.port: int = self._socket.getsockname()[1]

    def poll(self, now: float) -> None:
        """Accept who comes, and read, handle and write what is there."""
        self._accept(now)
        left = MOST_HANDLED
        for link, visitor in list(self._visitors.items()):
            if not self._read(link, visitor, now):
                self._dismiss(link)
                continue
            left -= visitor.work(left)
        if left <= 0 and len(self._visitors) > 1:
            # Who was first this time is last the next time.
            link = next(iter(self._visitors))
            self._visitors[link] = self._visitors.pop(link)
        for link, visitor in list(self._visitors.items()):
            if visitor.closing and visitor.deadline is None:
                visitor.deadline = now + CLOSING_S
            overdue = visitor.deadline is not None and now > visitor.deadline
            if not self._write(link, visitor) or overdue or (visitor.closing and not visitor.out):
                self._dismiss(link)

    def close(self) -> None:
        """Stop listening, and close all connections; twice is fine."""
        for link in list(self._visitors):
            self._dismiss(link)
        self._socket.close()

    def _accept(self, now: float) -> None:
        for _ in range(MOST_ACCEPTED):
            try:
                link, (address, *_) = self._socket.accept()
            except OSError:
                # No connection waits, or this process has no descriptor left.
                return
            if not self._make_room(now):
                link.close()
                continue
            link.setblocking(False)
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, round(LOST_S * 1000))
            visitor = self._visitors[link] = self._welcome(now, address)
            visitor.heard_at = now

    def _make_room(self, now: float) -> bool:
        """Whether there is a place for one more; one that was idle for long gives its own."""
        if len(self._visitors) < MOST_VISITORS:
            return True
        link = min(self._visitors, key=lambda link: self._visitors[link].heard_at)
        if now - self._visitors[link].heard_at < IDLE_S:
            return False
        self._dismiss(link)
        return True

    def _read(self, link: socket.socket, visitor: Visitor, now: float) -> bool:
        """Read what has come; False when the other side has closed."""
        try:
            for _ in range(MOST_READS):
                if visitor.closing or not visitor.wants_data():
                    break
                data = link.recv(READ_BYTES)
                if not data:
                    return False
                visitor.heard_at = now
                visitor.receive(data)
        except BlockingIOError:
            pass
        except OSError:
            return False
        return True

    def _write(self, link: socket.socket, visitor: Visitor) -> bool:
        try:
            while visitor.out:
                del visitor.out[: link.send(visitor.out)]
        except BlockingIOError:
            pass
        except OSError:
            return False
        return True

    def _dismiss(self, link: socket.socket) -> None:
        visitor = self._visitors.pop(link)
        with contextlib.suppress(OSError):
            link.close()
        visitor.leave()
