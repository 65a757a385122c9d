"""Who is gone, of those whose bytes are not read at present: clients that ended their sending side, or that sent more
than was run yet.

``asyncio`` looks at a connection only while it reads from it or has something to write.  So these are watched by an
``epoll`` of their own, which tells of an end that does not have to be read.

The end of a process that is killed and the end of a sending side look the same: both are a FIN.  A byte of urgent data
tells them apart: it is answered by a reset where nobody holds the socket any more, and a program that reads does not
see it.  It is sent once only, since a second one would make the first an ordinary byte.
"""

from __future__ import annotations

import asyncio
import contextlib
import select
import socket
from collections.abc import Callable
from typing import Final

GONE: Final = select.EPOLLHUP | select.EPOLLERR


class Departures:
    """Watches sockets that nobody reads."""

    def __init__(self) -> None:
        """Raises OSError when there is no descriptor left."""
        self._epoll = select.epoll()
        self._loop = asyncio.get_running_loop()
        self._watched: dict[int, tuple[Callable[[], None], Callable[[], None]]] = {}
        self._loop.add_reader(self._epoll.fileno(), self._look)

    def watch(self, number: int, gone: Callable[[], None], ended: Callable[[], None] | None = None) -> None:
        """Call ``gone()`` when the client behind a descriptor is gone; ``ended()`` when its sending side is."""
        events = 0 if ended is None else select.EPOLLRDHUP
        self._epoll.register(number, events)
        self._watched[number] = gone, ended if ended is not None else gone

    def forget(self, number: int) -> None:
        """Watch no more; harmless if it is not watched."""
        if self._watched.pop(number, None) is not None:
            with contextlib.suppress(OSError):
                self._epoll.unregister(number)

    def _look(self) -> None:
        for number, events in self._epoll.poll(0):
            if number not in self._watched:
                continue  # let go of by what another of them led to
            gone, ended = self._watched[number]
            if events & GONE:
                self.forget(number)
                gone()
            else:
                self._epoll.modify(number, 0)
                ended()

    def close(self) -> None:
        """Watch nobody any more."""
        self._loop.remove_reader(self._epoll.fileno())
        self._watched.clear()
        self._epoll.close()


def knock(connection: socket.socket) -> None:
    """Make a connection whose client is gone known as such; to be called once for each, when its input has ended."""
    if connection.family in (socket.AF_INET, socket.AF_INET6):
        with contextlib.suppress(OSError):  # what failed will be told by the watch
            connection.send(b"\n", socket.MSG_OOB)
