"""Detects the disconnect of clients that are not being read: those that closed their sending side, and those with too
much pending input.

``asyncio`` watches a connection only while it reads from it or has something to write.  These connections have an
``epoll`` of their own, which reports a hang-up without reading.

A killed process and a closed sending side look the same: both send a FIN.  A byte of urgent data tells them apart: if
no process holds the socket any more, the system answers with a reset; a program that reads does not see the byte.  It
is sent only once, since a second one would turn the first into an ordinary byte.
"""

from __future__ import annotations

import asyncio
import contextlib
import select
import socket
from collections.abc import Callable
from typing import Final

GONE: Final = select.EPOLLHUP | select.EPOLLERR


class DisconnectWatcher:
    """Watches sockets that are not being read."""

    def __init__(self) -> None:
        """Open the epoll.  Raises OSError when there is no descriptor left."""
        self._epoll = select.epoll()
        self._loop = asyncio.get_running_loop()
        self._watched: dict[int, tuple[Callable[[], None], Callable[[], None]]] = {}
        self._loop.add_reader(self._epoll.fileno(), self._look)

    def watch(self, number: int, gone: Callable[[], None], ended: Callable[[], None] | None = None) -> None:
        """Call ``gone()`` when the client behind a descriptor is gone, ``ended()`` when it has closed its sending
        side."""
        events = 0 if ended is None else select.EPOLLRDHUP
        self._epoll.register(number, events)
        self._watched[number] = gone, ended if ended is not None else gone

    def unwatch(self, number: int) -> None:
        """Stop watching a descriptor; harmless if it is not watched."""
        if self._watched.pop(number, None) is not None:
            with contextlib.suppress(OSError):
                self._epoll.unregister(number)

    def _look(self) -> None:
        for number, events in self._epoll.poll(0):
            if number not in self._watched:
                continue  # removed by the callback of another one
            gone, ended = self._watched[number]
            if events & GONE:
                self.unwatch(number)
                gone()
            else:
                self._epoll.modify(number, 0)
                ended()

    def close(self) -> None:
        """Stop watching and close the epoll."""
        self._loop.remove_reader(self._epoll.fileno())
        self._watched.clear()
        self._epoll.close()


def send_probe_byte(connection: socket.socket) -> None:
    """Provoke a reset if the client is gone.  Call this once for each connection, when its input has ended."""
    if connection.family in (socket.AF_INET, socket.AF_INET6):
        with contextlib.suppress(OSError):  # the watcher reports the failure
            connection.send(b"\n", socket.MSG_OOB)
