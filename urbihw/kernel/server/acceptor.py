"""Listening sockets, bound to an address or a path, and an accept loop that pauses when descriptors run out.

``asyncio`` has an accept loop, but when the process has no descriptor left, it logs a traceback for each client, again
and again.  Here the log gets one line, and accepting pauses until a connection is closed.
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

from urbihw.repeats import LimitedLog

log = logging.getLogger("urbihw.server")

BACKLOG: Final = 1024
"""Maximum number of connections that wait to be accepted.  Linux drops further requests; the client tries again after 1
s."""
MAX_ACCEPTS_PER_TURN: Final = 4
"""Maximum number of connections accepted in one callback; then other events get their turn.  Each costs about 1 ms,
most of it soon after the callback, when its lobby is opened and when it leaves."""
ACCEPT_RETRY_S: Final = 1.0
"""Seconds after which accepting is tried again although no connection was closed."""
EXHAUSTED: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
MAX_PATH_BYTES: Final = 107
"""Maximum length of the path of a UNIX socket, in bytes (``man 7 unix``)."""


def bind(host: str, port: int) -> list[socket.socket]:
    """Bind a socket to each address of a host.  They do not listen yet: no client can connect.

    With port 0 they share one free port.  Raises OSError, and UnicodeError for an impossible host name.
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


class UnixSocket(socket.socket):
    """A UNIX socket bound to a path; it remembers which file it created there."""

    def __init__(self) -> None:
        super().__init__(socket.AF_UNIX, socket.SOCK_STREAM)
        self._path: Path | None = None
        self._file: tuple[int, int] | None = None

    def bind_path(self, path: Path, mode: int) -> None:
        """Create the socket file with the permissions ``mode``.  Raises OSError."""
        self.bind(str(path))
        made = path.lstat()
        self._path, self._file = path.absolute(), (made.st_dev, made.st_ino)
        # No client can connect before listen(), so it is early enough to set the permissions here.
        os.chmod(path, mode)

    def unlink_file(self) -> None:
        """Remove the file, unless another one has replaced it."""
        if self._path is None:
            return
        with contextlib.suppress(OSError):
            there = self._path.lstat()
            if (there.st_dev, there.st_ino) == self._file:
                self._path.unlink()
        self._path = None


def bind_unix(path: Path, mode: int = 0o660) -> socket.socket:
    """Bind a UNIX socket to a path; it does not listen yet.

    The socket of a killed daemon is replaced.  Raises OSError: EADDRINUSE when a process listens there, EEXIST when the
    path is something else than a socket, ENAMETOOLONG.
    """
    if len(os.fsencode(path)) > MAX_PATH_BYTES:
        raise OSError(errno.ENAMETOOLONG, f"a path of more than {MAX_PATH_BYTES} bytes cannot be a socket")
    if path.is_socket():
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            if probe.connect_ex(str(path)) in (0, errno.EAGAIN):
                raise OSError(errno.EADDRINUSE, "somebody listens there")
        path.unlink(missing_ok=True)
    elif path.exists():
        raise OSError(errno.EEXIST, "something else than a socket is there")
    with contextlib.ExitStack() as stack:
        made = stack.enter_context(UnixSocket())
        stack.callback(made.unlink_file)
        made.bind_path(path, mode)
        stack.pop_all()
    return made


def release_socket(bound: socket.socket) -> None:
    """Close a socket of ``bind`` or ``bind_unix``, and remove the file of a UNIX socket."""
    if isinstance(bound, UnixSocket):
        bound.unlink_file()
    bound.close()


class Acceptor:
    """Accepts connections on one socket and calls ``accept_client(connection)`` for each."""

    def __init__(
        self, listener: socket.socket, accept_client: Callable[[socket.socket], None], limited_log: LimitedLog
    ) -> None:
        """Start to listen.  Raises OSError."""
        self._listener = listener
        self._accept_client = accept_client
        self._limited_log = limited_log
        self._loop = asyncio.get_running_loop()
        self._pause: asyncio.TimerHandle | None = None
        self._closed = False
        listener.setblocking(False)
        listener.listen(BACKLOG)
        self._loop.add_reader(listener.fileno(), self._accept)

    def accept_waiting(self) -> None:
        """Accept all who wait, now."""
        if self._pause is None and not self._closed:
            self._accept(BACKLOG)

    def _accept(self, most: int = MAX_ACCEPTS_PER_TURN) -> None:
        for _ in range(most):
            try:
                connection, _address = self._listener.accept()
            except (BlockingIOError, InterruptedError):
                return
            except OSError as error:
                if error.errno in EXHAUSTED:
                    self._pause_accepting(error)
                    return
                continue  # the client left before it was accepted
            self._accept_client(connection)

    def _pause_accepting(self, error: OSError) -> None:
        self._limited_log.say(
            "no connection can be accepted",
            f"no connection can be accepted: {error.strerror}; waiting for one to be closed: lower max_clients, or "
            "raise the limit (LimitNOFILE of the unit, ulimit -n)",
        )
        self._loop.remove_reader(self._listener.fileno())
        self._pause = self._loop.call_later(ACCEPT_RETRY_S, self.resume_accepting)

    def resume_accepting(self) -> None:
        """A connection was closed: resume accepting if it pauses."""
        if self._pause is not None and not self._closed:
            self._pause.cancel()
            self._pause = None
            self._loop.add_reader(self._listener.fileno(), self._accept)

    def close(self) -> None:
        """Stop accepting clients, and close the socket."""
        if self._closed:
            return
        self._closed = True
        if self._pause is not None:
            self._pause.cancel()
        self._loop.remove_reader(self._listener.fileno())
        release_socket(self._listener)
