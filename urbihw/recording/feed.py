"""The lines of a worker, read in a thread, so that a slow disk holds up neither the socket nor the worker.

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
from urbihw.control_line import ControlLine, question

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


class WorkerFeed:
    """Reads what a worker tells to those who record; a worker that ended is waited for.

    Attributes:
        queue: the lines, and a line of an event ``Feed`` when the worker is there or gone.
    """

    def __init__(self, path: Path) -> None:
        """Connect.  Raises OSError, and ValueError when what answers is no worker that can be recorded."""
        self.queue = LineQueue()
        self._path = path
        self._ending = threading.Event()
        self._line = self._connect()
        self._thread = threading.Thread(target=self._read, name="feed", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the connection and the thread; calling it twice is fine."""
        self._ending.set()
        self._line.close()
        self._thread.join(_MAX_PAUSE_S)

    def _connect(self) -> ControlLine:
        line = ControlLine(self._path, MOST_LINE_BYTES)
        try:
            line.send(question("record", WHO))
            first = line.next_line(time.monotonic() + 1.0)
            told = json.loads(first)
            if not isinstance(told, dict) or told.get("ok") is not True or told.get("do") != "record":
                raise ValueError(f"{self._path}: this daemon cannot be recorded; is it of the same version?")
            line.send(json.dumps({"do": "values", "hz": VALUES_HZ}).encode() + b"\n")
        except BaseException:
            line.close()
            raise
        self.queue.put(first)
        return line

    def _read(self) -> None:
        pauses = BackOff(_FIRST_PAUSE_S, _MAX_PAUSE_S)
        while not self._ending.is_set():
            try:
                while not self._ending.is_set():
                    self.queue.put(self._line.next_line(time.monotonic() + _LOOK_S))
            except TimeoutError:
                continue
            except (OSError, ValueError) as error:
                if self._ending.is_set():
                    return
                self._line.close()
                self._tell("gone", str(error) or "it ended the connection")
            while not self._ending.wait(pauses.next_pause()):
                try:
                    self._line = self._connect()
                except (OSError, ValueError):
                    continue
                pauses.reset()
                self._tell("back", "")
                break

    def _tell(self, what: str, why: str) -> None:
        event = {"event": "Feed", "what": f"the worker is {what}", "reason": why, "at": time.monotonic()}
        self.queue.put(json.dumps(event).encode())
