"""Bytes that come and go when they please, for ``process`` and ``stream``: threads read and write, jobs wait.

What a thread finds out reaches the kernel by ``scheduler.post`` and nothing else; a job that reads what is not there
yet waits, and only it.
"""

from __future__ import annotations

import os
import queue
import threading
from typing import IO, Any

from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.waiting import WaitQueue

LIMIT = 16 * 1024 * 1024
"""How many bytes may wait for somebody to read them; whoever writes more has to wait, as with any pipe."""


class PipeSource:
    """What a program says: filled from a thread, read by jobs."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._waiting = WaitQueue(scheduler)
        self._data = bytearray()
        self._ended = False
        self._room = threading.Condition()
        self._unread = 0

    def reserve(self, size: int) -> None:
        """From the thread that fills: wait until there is room for more, and take it."""
        with self._room:
            while self._unread > LIMIT:
                self._room.wait()
            self._unread += size

    def feed(self, data: bytes) -> None:
        """More was said; nothing means the end."""
        self._data += data
        if self._ended:  # nobody will read it
            self._take(len(self._data))
        self._ended = self._ended or not data
        self._waiting.wake_all()

    def byte(self) -> bytes:
        """The next byte, waited for; empty at the end."""
        while not self._data and not self._ended:
            self._waiting.wait()
        return self._take(1)

    def line(self) -> bytes:
        """The rest of the line with its end, waited for; empty at the end.  One that is too long comes in pieces."""
        while b"\n" not in self._data and not self._ended and len(self._data) <= LIMIT:
            self._waiting.wait()
        return self._take(self._data.find(b"\n") + 1 or len(self._data))

    def close(self) -> None:
        """No more is wanted: what still comes is thrown away."""
        self._ended = True
        self._take(len(self._data))

    def _take(self, size: int) -> bytes:
        taken = bytes(self._data[:size])
        del self._data[:size]
        with self._room:
            self._unread -= len(taken)
            self._room.notify()
        return taken


class PipeSink:
    """What is said to a program: kept until it runs, then written by a thread."""

    def __init__(self) -> None:
        self._pieces: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._waiting = 0

    def write(self, data: bytes) -> None:
        """Say something.  Raises OSError when too much waits already."""
        if data:
            with self._lock:
                if self._waiting > LIMIT:
                    raise OSError(f"the other side does not read: {self._waiting} bytes wait for it")
                self._waiting += len(data)
            self._pieces.put(data)

    def flush(self) -> None:
        """The thread writes as soon as it can."""

    def close(self) -> None:
        """Nothing more will be said."""
        self._pieces.put(b"")

    def pump(self, pipe: IO[bytes]) -> None:
        """Write all that comes, in a thread."""
        try:
            with pipe:
                for piece in iter(self._pieces.get, b""):
                    pipe.write(piece)
                    pipe.flush()
                    with self._lock:
                        self._waiting -= len(piece)
        except OSError:
            return  # the program does not listen any more


def in_background(target: Any, *args: Any) -> threading.Thread:
    """Call something in a thread that does not keep the process alive."""
    made = threading.Thread(target=target, args=args, name="pipe", daemon=True)
    made.start()
    return made


def pump_in(pipe: IO[bytes], source: PipeSource, scheduler: Scheduler) -> None:
    """Feed a source with all that comes out of a pipe, in a thread."""
    with pipe:
        data = b"x"
        while data:
            try:
                data = os.read(pipe.fileno(), 65536)
            except OSError:  # a terminal or a device whose other side is gone
                data = b""
            source.reserve(len(data))
            scheduler.post(lambda data=data: source.feed(data))  # type: ignore[misc]
