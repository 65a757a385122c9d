"""Where clients come in: sockets bound by address or path, and accepting that pauses when nothing is left to accept by.

``asyncio`` accepts by itself, but when the process has no descriptor left, it logs a traceback for each client, again
and again.  Here that is one line, and accepting pauses until a connection is closed.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Final

from urbihw.kernel.server.thinned import Thinned

log = logging.getLogger("urbihw.server")

BACKLOG: Final = 128
BURST: Final = 32
"""Connections accepted in one go; then the others get their turn."""
PAUSE: Final = 1.0
"""Seconds after which accepting is tried again, though no connection was closed meanwhile."""
EXHAUSTED: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
LONGEST_PATH: Final = 107
"""Bytes of the path of a UNIX socket (``man 7 unix``)."""


def bind(host: str, port: int) -> list[socket.socket]:
    """Sockets bound to all addresses of a host, which do not listen yet: no client can connect.

    With port 0 they share a free one.  Raises OSError, and UnicodeError for what cannot be the name of a host.
    """
    found = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    made: list[socket.socket] = []
    with contextlib.ExitStack() as stack:
        for family, kind, proto, _, address in dict.fromkeys(found):
            one = stack.enter_context(socket.socket(family, kind, proto))
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                one.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            one.bind((address[0], made[0].getsockname()[1] if made else port, *address[2:]))
            made.append(one)
        stack.pop_all()
    return made


def bind_unix(path: Path, mode: int = 0o660) -> socket.socket:
    """A UNIX socket at a path, which does not listen yet.

    What a daemon left there that was killed is replaced.  Raises OSError: EADDRINUSE when somebody listens there,
    EEXIST when something else than a socket is in the way, ENAMETOOLONG.
    """
    if len(os.fsencode(path)) > LONGEST_PATH:
        raise OSError(errno.ENAMETOOLONG, f"a path of more than {LONGEST_PATH} bytes cannot be a socket")
    if path.is_socket():
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            if probe.connect_ex(str(path)) in (0, errno.EAGAIN):
                raise OSError(errno.EADDRINUSE, "somebody listens there")
        path.unlink(missing_ok=True)
    elif path.exists():
        raise OSError(errno.EEXIST, "something else than a socket is there")
    with contextlib.ExitStack() as stack:
        made = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
        made.bind(str(path))
        # Until it listens nobody can connect, so the rights come in time.
        os.chmod(path, mode)
        stack.pop_all()
    return made


def let_go(bound: socket.socket) -> None:
    """Close a socket of ``bind`` or ``bind_unix``; the file of a UNIX socket goes."""
    if bound.family == socket.AF_UNIX and bound.fileno() >= 0:
        with contextlib.suppress(OSError):
            os.unlink(bound.getsockname())
    bound.close()


class Door:
    """Accepts connections on one socket; ``come(connection)`` takes each."""

    def __init__(self, listener: socket.socket, come: Callable[[socket.socket], None], thinned: Thinned) -> None:
        """Listen.  Raises OSError."""
        self._listener = listener
        self._come = come
        self._thinned = thinned
        self._loop = asyncio.get_running_loop()
        self._pause: asyncio.TimerHandle | None = None
        self._closed = False
        listener.setblocking(False)
        listener.listen(BACKLOG)
        self._loop.add_reader(listener.fileno(), self._accept)

    def _accept(self) -> None:
        for _ in range(BURST):
            try:
                connection, _address = self._listener.accept()
            except (BlockingIOError, InterruptedError):
                return
            except OSError as error:
                if error.errno in EXHAUSTED:
                    self._rest(error)
                    return
                continue  # a client that left before it was accepted
            self._come(connection)

    def _rest(self, error: OSError) -> None:
        self._thinned.warning(
            "no connection can be accepted",
            f"no connection can be accepted: {error.strerror}; waiting for one to be closed: lower max_clients, or "
            "raise the limit (LimitNOFILE of the unit, ulimit -n)",
        )
        self._loop.remove_reader(self._listener.fileno())
        self._pause = self._loop.call_later(PAUSE, self.resume)

    def resume(self) -> None:
        """A connection was closed: accept again if accepting pauses."""
        if self._pause is not None and not self._closed:
            self._pause.cancel()
            self._pause = None
            self._loop.add_reader(self._listener.fileno(), self._accept)

    def close(self) -> None:
        """Accept no more."""
        if self._closed:
            return
        self._closed = True
        if self._pause is not None:
            self._pause.cancel()
        self._loop.remove_reader(self._listener.fileno())
        let_go(self._listener)
