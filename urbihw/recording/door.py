"""How a running recorder is asked: a UNIX socket, one line of JSON in, one line out; never waits for a client.

    > {"do": "stop"}                  end the recording
    < {"ok": true, "told": "/home/me/lesson1.mcap"}
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from urbihw.control_line import ControlLine

ANSWER_TIMEOUT_S: Final = 30.0
"""Seconds for an answer: the last minutes are written meanwhile."""
_MOST_BYTES: Final = 4096
_CLIENT_S: Final = 1.0
"""Seconds that a client has for its line."""


class DoorTaken(Exception):
    """Another recorder listens there; the message names the place."""


class RecorderDoor:
    """Listens at ``path``; ``answer`` gets the verb and returns the answer to the client.

    Raises DoorTaken, OSError.
    """

    def __init__(self, path: Path, answer: Callable[[str], str]) -> None:
        self.path = path
        self._answer = answer
        with contextlib.suppress(OSError, ValueError):
            ask(path, "state")
            raise DoorTaken(str(path))
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
        before = os.umask(0o177)
        try:
            self._listener.bind(str(path))
        finally:
            os.umask(before)
        self._listener.listen(4)
        self._listener.setblocking(False)

    def poll(self) -> None:
        """Answer one client, if one has come."""
        try:
            client, _ = self._listener.accept()
        except OSError:
            return
        with client:
            client.settimeout(_CLIENT_S)
            try:
                told = json.loads(client.recv(_MOST_BYTES))
                line: dict[str, Any] = {"ok": True, "told": self._answer(str(told["do"]))}
            except (OSError, ValueError, KeyError, TypeError, RecursionError):
                line = {"ok": False}
            with contextlib.suppress(OSError):
                client.sendall(json.dumps(line).encode() + b"\n")

    def close(self) -> None:
        """End listening; calling it twice is fine."""
        if self._listener.fileno() >= 0:
            self._listener.close()
            self.path.unlink(missing_ok=True)


def ask(path: Path, verb: str) -> str:
    """Ask the recorder that listens at a path; return what it tells.

    Raises OSError if there is none, or no answer, and ValueError for an answer without sense.
    """
    line = ControlLine(path)
    try:
        line.send(json.dumps({"do": verb}).encode() + b"\n")
        told = line.next_told(time.monotonic() + ANSWER_TIMEOUT_S)
    finally:
        line.close()
    if not isinstance(told, dict) or told.get("ok") is not True:
        raise ValueError(f"{path}: what answers there is no recorder")
    return str(told.get("told", ""))
