"""The lines of a worker and of a daemon, read in threads, so that a slow disk holds up neither the sockets nor them.

The queue between this thread and its reader has a size in bytes; beyond it the oldest lines are dropped and counted.
"""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from pathlib import Path
from typing import Final

from urbihw.backoff import BackOff
from urbihw.control_line import ANSWER_TIMEOUT_S, ControlLine, question

MOST_QUEUED_BYTES: Final = 16 << 20
"""Bytes that wait for the reader: more than a minute of a full wire."""
MOST_LINE_BYTES: Final = 4 << 20
VALUES_HZ: Final = 10.0
"""How often the values are asked for in SI units; raw counts come with each tick."""
WHO: Final = "urbihw record"
_FIRST_PAUSE_S: Final = 0.25
_MAX_PAUSE_S: Final = 2.0
_LOOK_S: Final = 0.5
"""Seconds between two looks whether the feed is to end."""


class LineQueue:
    """Lines between two threads, bounded in bytes; of too many the oldest are dropped."""

    def __init__(self, most: int = MOST_QUEUED_BYTES) -> None:
        self._most = most
        self._lines: deque[bytes] = deque()
        self._size = 0
        self._lost = 0
        self._changed = threading.Condition()

    def put(self, line: bytes) -> None:
        """Add a line; it may push the oldest ones out."""
        with self._changed:
            self._lines.append(line)
            self._size += len(line)
            while self._size > self._most and len(self._lines) > 1:
                self._size -= len(self._lines.popleft())
                self._lost += 1
            self._changed.notify()

    def wake(self) -> None:
        """Let a ``take`` that waits return."""
        with self._changed:
            self._changed.notify()

    def take(self, timeout: float) -> tuple[list[bytes], int]:
        """Return all lines, and how many were dropped since the last call; waits for the first for some seconds."""
        with self._changed:
            if not self._lines:
                self._changed.wait(timeout)
            lines, lost = list(self._lines), self._lost
            self._lines.clear()
            self._size = self._lost = 0
            return lines, lost


class SocketFeed:
    """Reads lines from a socket into a queue, in a thread; a socket that has ended is connected to again.

    ``name`` is that of the other side, for an event ``Feed`` in the queue when it is gone or back.
    """

    def __init__(self, path: Path, queue: LineQueue, name: str) -> None:
        """Connect.  Raises OSError, and ValueError when what answers there is not what it should be."""
        self._path = path
        self._queue = queue
        self._name = name
        self._ending = threading.Event()
        self._line = self._connect()
        self._thread = threading.Thread(target=self._read, name=f"feed of the {name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the connection and the thread; calling it twice is fine."""
        self._ending.set()
        self._thread.join(_MAX_PAUSE_S)
        self._line.close()

    def _connect(self) -> ControlLine:
        line = ControlLine(self._path, MOST_LINE_BYTES)
        try:
            self._greet(line)
        except BaseException:
            line.close()
            raise
        return line

    def _greet(self, line: ControlLine) -> None:
        """Say what is wanted on a new connection.  Raises OSError, ValueError."""

    def _read(self) -> None:
        pauses = BackOff(_FIRST_PAUSE_S, _MAX_PAUSE_S)
        while not self._ending.is_set():
            try:
                self._queue.put(self._line.next_line(time.monotonic() + _LOOK_S))
            except TimeoutError:
                continue
            except (OSError, ValueError) as error:
                self._line.close()
                self._tell("gone", str(error) or "it ended the connection")
                self._connect_again(pauses)

    def _connect_again(self, pauses: BackOff) -> None:
        while not self._ending.wait(pauses.next_pause()):
            try:
                self._line = self._connect()
            except (OSError, ValueError):
                continue
            pauses.reset()
            self._tell("back", "")
            return

    def _tell(self, what: str, why: str) -> None:
        event = {"event": "Feed", "what": f"the {self._name} is {what}", "reason": why, "at": time.monotonic()}
        self._queue.put(json.dumps(event).encode())


class WorkerFeed(SocketFeed):
    """What a worker tells to those who record."""

    def __init__(self, path: Path, queue: LineQueue) -> None:
        super().__init__(path, queue, "worker")

    def _greet(self, line: ControlLine) -> None:
        line.send(question("record", WHO))
        first = line.next_line(time.monotonic() + ANSWER_TIMEOUT_S)
        told = json.loads(first)
        if not isinstance(told, dict) or told.get("ok") is not True or told.get("do") != "record":
            raise ValueError(f"{self._path}: this daemon cannot be recorded; is it of the same version?")
        line.send(json.dumps({"do": "values", "hz": VALUES_HZ}).encode() + b"\n")
        self._queue.put(first)


class DaemonFeed(SocketFeed):
    """What a daemon tells to those who record: settings, log, clients."""

    def __init__(self, path: Path, queue: LineQueue) -> None:
        super().__init__(path, queue, "daemon")
