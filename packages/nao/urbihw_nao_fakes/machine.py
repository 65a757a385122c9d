"""What libqi calls this computer.

A client of libqi connects to an end point on loopback only where the directory says that it is on the client's own
machine.  libqi keeps the identifier of a machine in a file of the user, and makes one where there is none.
"""

from __future__ import annotations

import os
import socket
import uuid
from pathlib import Path

LONGEST = 100


def find_machine_id(home: Path | None = None) -> str:
    """The identifier of this computer for clients of this user; it is made where libqi has not made it yet."""
    file = (home or Path.home()) / ".config" / "qimessaging" / "machine_id"
    found = _read(file)
    if found:
        return found
    made = str(uuid.uuid4())
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644), "w") as out:
            out.write(made)
    except FileExistsError:
        return _read(file) or made
    except OSError:
        # It is not kept: clients of libqi on this computer have another one each time, too.
        return str(uuid.uuid5(uuid.NAMESPACE_DNS, socket.gethostname()))
    return made


def _read(file: Path) -> str:
    try:
        return file.read_text("ascii", "replace")[:LONGEST].strip()
    except OSError:
        return ""
