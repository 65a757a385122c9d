"""The second address of a bus worker: an abstract socket, named after the file of its control socket.

A file can be deleted under a worker; an abstract name cannot, and it ends with the process.  Anybody may take such a
name and connect to it, so both sides look at who the other one is.
"""

from __future__ import annotations

import os
import socket
import struct

PREFIX = "urbihw:"
"""What the name begins with; the path of the file follows."""
_CREDENTIALS = "3i"


def abstract_address(control: str | os.PathLike[str]) -> bytes:
    """The address of the abstract socket of the worker with this control socket."""
    return b"\0" + (PREFIX + os.path.abspath(control)).encode("utf-8", "surrogateescape")


def local_user(number: int) -> str:
    """Whose emergency stop it is that a user of this machine presses, whatever terminal or program is used."""
    return f"uid {number}"


def user_at(connection: socket.socket) -> int:
    """The number of the user at the other end of a UNIX socket.  Raises OSError."""
    raw = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize(_CREDENTIALS))
    user: int = struct.unpack(_CREDENTIALS, raw)[1]
    return user
