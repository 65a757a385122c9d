"""How a running recorder is asked: a UNIX socket, one line of JSON in, one line out; never waits for a client.

    > {"do": "stop"}                  end the recording
    < {"ok": true, "told": "/home/me/lesson1.mcap"}
    > {"do": "last"}                  write the last minutes
    < {"ok": false, "why": "/home/me: the disk is away"}
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from urbihw.control_line import ControlLine
from urbihw.recording.recording_file import RecordingRefused
from urbihw.settings import escape_unprintable

ANSWER_TIMEOUT_S: Final = 30.0
"""Seconds for an answer: the last minutes are written meanwhile."""
_MOST_BYTES: Final = 4096
_MOST_CLIENTS: Final = 4
_CLIENT_S: Final = 1.0
"""Seconds that a client has for its line."""


class DoorTaken(Exception):
    """Another recorder listens there; the message names the place."""


class RecorderDoor:
    """Listens at ``path``; ``answer`` gets the verb and returns the answer to the client.

    Who answers raises RecordingRefused for what does not work, whose words the client gets. Raises DoorTaken, OSError.
    """

    def __init__(self, path: Path, answer: Callable[[str], str]) -> None:
        self.path = path
        self._answer = answer
        self._clients: list[_DoorClient] = []
        if _is_listened_at(path):
            raise DoorTaken(str(path))
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
        before = os.umask(0o177)
        try:
            self._listener.bind(str(path))
        finally:
            os.umask(before)
        self._place = _place_of(path)
        self._listener.listen(_MOST_CLIENTS)
        self._listener.setblocking(False)

    def poll(self) -> None:
        """Answer the clients whose lines are there; call this a few times a second."""
        with contextlib.suppress(OSError):
            while len(self._clients) < _MOST_CLIENTS:
                client, _ = self._listener.accept()
                client.setblocking(False)
                self._clients.append(_DoorClient(client, time.monotonic() + _CLIENT_S))
        waiting = []
        for each in self._clients:
            if each.is_ready():
                each.answer(self._answer)
            else:
                waiting.append(each)
        self._clients = waiting

    def close(self) -> None:
        """End listening; calling it twice is fine. A socket that another recorder has made there meanwhile stays."""
        if self._listener.fileno() < 0:
            return
        self._listener.close()
        for each in self._clients:
            each.socket.close()
        with contextlib.suppress(FileNotFoundError):
            if _place_of(self.path) == self._place:
                self.path.unlink()


@dataclass
class _DoorClient:
    """A client that has come: its socket, the end of its time, and what it has sent."""

    socket: socket.socket
    until: float
    heard: bytes = b""

    def is_ready(self) -> bool:
        """Read what is there; return whether the line is complete, or does not come any more."""
        try:
            data = self.socket.recv(_MOST_BYTES)
        except BlockingIOError:
            return time.monotonic() > self.until
        except OSError:
            return True
        self.heard += data
        return not data or b"\n" in self.heard or len(self.heard) > _MOST_BYTES

    def answer(self, answer: Callable[[str], str]) -> None:
        """Answer the line, and end the connection."""
        with self.socket, contextlib.suppress(OSError):
            try:
                told = json.loads(self.heard)
                line: dict[str, Any] = {"ok": True, "told": answer(str(told["do"]))}
            except RecordingRefused as error:
                line = {"ok": False, "why": str(error)}
            except (OSError, ValueError, KeyError, TypeError, RecursionError):
                line = {"ok": False}
            self.socket.sendall(json.dumps(line).encode() + b"\n")


def _is_listened_at(path: Path) -> bool:
    """Whether a process listens at a path; it may be busy, and need not answer.  Raises OSError if that is not known.
    """
    try:
        ControlLine(path).close()
    except (FileNotFoundError, ConnectionRefusedError):
        return False
    except (BlockingIOError, TimeoutError):
        return True
    return True


def _place_of(path: Path) -> tuple[int, int]:
    """What tells a file from another one of its name."""
    found = os.lstat(path)
    return found.st_dev, found.st_ino


def ask(path: Path, verb: str) -> str:
    """Ask the recorder that listens at a path; return what it tells.

    Raises OSError if there is none, or no answer, RecordingRefused with its words for what does not work, and
    ValueError for an answer without sense.
    """
    line = ControlLine(path)
    try:
        line.send(json.dumps({"do": verb}).encode() + b"\n")
        told = line.next_told(time.monotonic() + ANSWER_TIMEOUT_S)
    finally:
        line.close()
    if isinstance(told, dict) and told.get("ok") is False and "why" in told:
        raise RecordingRefused(escape_unprintable(str(told["why"])))
    if not isinstance(told, dict) or told.get("ok") is not True:
        raise ValueError(f"{path}: what answers there is no recorder")
    return str(told.get("told", ""))
