"""Listening sockets passed by the service manager (socket activation).

Source: ``man 3 sd_listen_fds``.  ``LISTEN_FDS`` is the number of descriptors, from 3 on, for the process in
``LISTEN_PID``; ``LISTEN_FDNAMES`` are their names, joined by colons (``FileDescriptorName`` of the socket unit).
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import MutableMapping
from typing import Final

from urbihw.kernel.uobject import BadConfig

FIRST_DESCRIPTOR: Final = 3
_VARIABLES: Final = ("LISTEN_PID", "LISTEN_FDS", "LISTEN_FDNAMES")


def passed_sockets(
    port: int,
    environment: MutableMapping[str, str] = os.environ,
    *,
    pid: int | None = None,
    first: int = FIRST_DESCRIPTOR,
) -> list[socket.socket]:
    """The listening TCP sockets that the service manager has passed to this process; [] for none.

    ``port`` is that of the settings, 0 for any.  The variables are removed, so that no child takes the sockets for its
    own.  Raises BadConfig for a descriptor that is no listening TCP socket, and for another port than that of the
    settings.
    """
    whose, count, names = (environment.pop(name, "") for name in _VARIABLES)
    if whose != str(os.getpid() if pid is None else pid) or not count.isdecimal():
        return []
    found: list[socket.socket] = []
    with contextlib.ExitStack() as stack:
        for descriptor, name in zip(range(first, first + int(count)), names.split(":"), strict=False):
            passed = stack.enter_context(_socket_at(descriptor, count))
            os.set_inheritable(descriptor, False)
            _check_port(passed, name, port)
            found.append(passed)
        stack.pop_all()
    return found


def _socket_at(descriptor: int, count: str) -> socket.socket:
    """The socket of a descriptor.  Raises BadConfig if it is not a socket."""
    try:
        return socket.socket(fileno=descriptor)
    except OSError as error:
        raise BadConfig(
            f"LISTEN_FDS is {count}, but descriptor {descriptor} is no socket ({error.strerror}): start urbihw by the "
            "socket unit, or without LISTEN_FDS"
        ) from error


def _check_port(passed: socket.socket, name: str, port: int) -> None:
    """Check that a socket is the TCP port of the settings.  Raises BadConfig."""
    if passed.family not in (socket.AF_INET, socket.AF_INET6) or passed.type != socket.SOCK_STREAM:
        raise BadConfig(f"the service manager passes a socket ({name}) that is no TCP port: correct ListenStream of "
                        "the socket unit")
    if not passed.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
        raise BadConfig(f"the service manager passes a socket ({name}) that does not listen: Accept=no in the socket "
                        "unit, and LISTEN_FDS is the number of its ports")
    actual = passed.getsockname()[1]
    if port not in (0, actual):
        raise BadConfig(f"the service manager passes port {actual}, but the settings say port {port}: correct "
                        "ListenStream of the socket unit, or port")
