"""Bytes that come and go when they please, for ``process``, ``stream`` and ``file``: the thread of the ``poller`` reads
and writes, jobs wait.

What the thread finds out reaches the kernel by ``scheduler.post`` and nothing else.  It reads ahead of the programs, so
that who writes can go on, but only so far: then it waits until they have taken some of it, and who writes waits, as
with any pipe.  What is done with the bytes is done by the job that asks for them.
"""

from __future__ import annotations

import errno
import os
import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Final
from weakref import WeakKeyDictionary

from urbihw.kernel.runtime.holdings import Holdings
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.waiting import WaitQueue
from urbihw.kernel.stdlib.aside import Aside
from urbihw.kernel.stdlib.poller import AGAIN, LATER, NOTHING, OVER, READ, WRITE, Poller

CHUNK: Final = 65536
"""How many bytes are read or written at once, and how many of each source may wait in any case."""
LIMIT: Final = 16 * 1024 * 1024
"""How many bytes of all sources of a connection may wait for its programs; the same of each sink for the other side."""
LONGEST_LINE: Final = 1024 * 1024
"""A line of more bytes comes in pieces."""
OPENED: Final = os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY
"""How files that may let wait are opened."""


class Pipes:
    """What the pipes of a kernel share; ``world.pipes``."""

    def __init__(self, world: World) -> None:
        self.scheduler = world.scheduler
        self.poller = Poller()
        self.starts = Aside(world, lambda: None)
        """Where programs are started, one after the other: each start keeps all threads waiting for a moment."""
        self._backlogs: WeakKeyDictionary[Holdings, Backlog] = WeakKeyDictionary()

    def backlog(self, holdings: Holdings) -> Backlog:
        """What waits for the programs of a connection."""
        found = self._backlogs.get(holdings)
        if found is None:
            found = self._backlogs[holdings] = Backlog(self.poller, LIMIT)
        return found


def pipes_of(world: World) -> Pipes:
    """The pipes of a world."""
    if world.pipes is None:
        world.pipes = Pipes(world)
    found: Pipes = world.pipes
    return found


class Backlog:
    """How many bytes of some sources wait to be taken by programs."""

    def __init__(self, poller: Poller, limit: int) -> None:
        self._poller = poller
        self._limit = limit
        self._lock = threading.Lock()
        self._size = 0
        self._paused: dict[PipeSource, None] = {}
        self.gathered = 0
        """How many bytes jobs have taken that read devices and fifos as a whole; belongs to the kernel."""

    def has_room(self, source: PipeSource) -> bool:
        """In the thread: whether a source may read on.  If not, it is attended to again when it may."""
        with self._lock:
            if source.unread < source.allowed or self._size < self._limit:
                return True
            self._paused[source] = None
            return False

    def add(self, source: PipeSource, size: int) -> None:
        """In the thread: a source has read."""
        with self._lock:
            source.unread += size
            self._size += size

    def take(self, source: PipeSource, size: int) -> None:
        """In the kernel: a program has taken some bytes of a source, or is allowed more."""
        with self._lock:
            source.unread -= size
            self._size -= size
            if not self._paused:
                return
            if self._size <= self._limit // 2:
                resumed = list(self._paused)
            else:
                resumed = [source] if source in self._paused and source.unread < source.allowed else []
            for one in resumed:
                del self._paused[one]
        for one in resumed:
            self._poller.attend(one)


class PipeSource:
    """What a program says: read in the thread, taken by jobs."""

    def __init__(self, pipes: Pipes) -> None:
        self._pipes = pipes
        self._waiting = WaitQueue(pipes.scheduler)
        self._data = bytearray()
        self.ended = False
        self.on_end: Callable[[], None] = lambda: None
        self.allowed = CHUNK
        """So many bytes may wait, whatever else does."""
        self.unread = 0
        """So many do; belongs to the backlog."""
        # of the thread, and behind the lock what both sides use
        self.descriptor = -1
        self._backlog: Backlog
        self._waits_first = False
        self._lock = threading.Lock()
        self._come: deque[bytes] = deque()
        self._closed = False

    def __len__(self) -> int:
        """How many bytes are there."""
        return len(self._data)

    def start(self, descriptor: int, backlog: Backlog, waits_first: bool = False) -> None:
        """Begin to read an open file that does not block; it is closed in the end.

        ``waits_first``: the end of a fifo is no end before somebody has begun to write to it.
        """
        self.descriptor, self._backlog, self._waits_first = descriptor, backlog, waits_first
        self._pipes.poller.attend(self)

    def finish(self) -> None:
        """Nothing more will come."""
        if not self.ended:
            self.ended = True
            self.on_end()
        self._waiting.wake_all()

    # ---------------------------------------------------------------- for jobs

    def byte(self) -> bytes:
        """The next byte, waited for; empty at the end."""
        while not self._data and not self.ended:
            self._waiting.wait()
        return self._take(1)

    def some(self) -> bytes:
        """What is there, waited for; empty at the end."""
        while not self._data and not self.ended:
            self._waiting.wait()
        return self._take(len(self._data))

    def line(self) -> bytes:
        """The rest of the line with its end, waited for; empty at the end.  One that is too long comes in pieces."""
        searched = 0
        while (at := self._data.find(b"\n", searched)) < 0 and not self.ended and len(self._data) < LONGEST_LINE:
            searched = len(self._data)
            if searched >= CHUNK and self.allowed == CHUNK:
                self.allowed = LONGEST_LINE
                self._backlog.take(self, 0)
            self._waiting.wait()
            searched = min(searched, len(self._data))  # somebody else may have taken some
        return self._take(min(at + 1 or len(self._data), LONGEST_LINE))

    def close(self) -> None:
        """No more is wanted: what is there is thrown away, and who still writes is told by the system."""
        self._closed = True
        self.finish()
        self._take(len(self._data))
        if self.descriptor >= 0:
            self._pipes.poller.attend(self)

    def _take(self, size: int) -> bytes:
        taken = bytes(self._data[:size])
        del self._data[:size]
        if taken:
            self._backlog.take(self, len(taken))
        return taken

    def _arrived(self) -> None:
        """The thread has read something."""
        with self._lock:
            come, self._come = self._come, deque()
        for piece in come:
            self._data += piece
        if self._closed:
            self._take(len(self._data))
        if not come[-1]:
            self.finish()
        self._waiting.wake_all()

    # ---------------------------------------------------------------- for the thread

    def ready(self) -> int:
        """Read on, if there is room."""
        if self._closed:
            return OVER
        if self._waits_first:
            self._waits_first = False
            return READ
        if not self._backlog.has_room(self):
            return NOTHING
        try:
            data = os.read(self.descriptor, CHUNK)
        except BlockingIOError:
            return READ
        except OSError:  # a terminal or a device whose other side is gone
            data = b""
        self._backlog.add(self, len(data))
        with self._lock:
            self._come.append(data)
            told = len(self._come) > 1
        if not told:
            self._pipes.scheduler.post(self._arrived)
        return AGAIN if data else OVER


class PipeSink:
    """What is said to a program: kept until it runs, then written in the thread."""

    def __init__(self, pipes: Pipes) -> None:
        self._pipes = pipes
        self._drained = WaitQueue(pipes.scheduler)
        self.on_end: Callable[[], None] = lambda: None
        """Called in the kernel when the file is closed."""
        self.descriptor = -1
        # behind the lock: of both sides
        self._lock = threading.Lock()
        self._pieces: deque[memoryview] = deque()
        self._size = 0
        self._closing = False
        self._deaf = False
        """Whether nobody reads any more: what is said is thrown away."""

    def start(self, descriptor: int) -> None:
        """Begin to write to an open file that does not block; it is closed in the end."""
        self.descriptor = descriptor
        self._pipes.poller.attend(self)

    def write(self, data: bytes) -> None:
        """Say something.  Raises OSError when too much waits already."""
        if not data:
            return
        with self._lock:
            if self._deaf:
                return
            if self._size > LIMIT:
                raise OSError(f"the other side does not read: {self._size} bytes wait for it")
            self._size += len(data)
            self._pieces.append(memoryview(data))
        self._attend()

    def flush(self) -> None:
        """The thread writes as soon as it can."""

    def close(self) -> None:
        """Nothing more will be said; what was is delivered."""
        self._closing = True
        self._attend()

    def drop(self) -> None:
        """Nothing more will be said, and what waits is thrown away."""
        self._forget()
        self.close()

    def wait_until_written(self) -> None:
        """Wait until all that was said is delivered, or nobody reads any more."""
        while self._size:
            self._drained.wait()

    def _attend(self) -> None:
        if self.descriptor >= 0:
            self._pipes.poller.attend(self)

    def _forget(self) -> None:
        with self._lock:
            self._deaf = True
            self._pieces.clear()
            self._size = 0

    # ---------------------------------------------------------------- for the thread

    def ready(self) -> int:
        """Write on."""
        with self._lock:
            piece = self._pieces[0] if self._pieces else None
        if piece is None:
            return self._over() if self._closing else NOTHING
        try:
            written = os.write(self.descriptor, piece[:CHUNK])
        except BlockingIOError:
            return WRITE
        except OSError:  # the program does not listen any more
            self._forget()
            return self._over()
        with self._lock:
            if self._pieces:
                self._size -= written
                self._pieces[0] = piece[written:]
                if not self._pieces[0]:
                    self._pieces.popleft()
                if not self._pieces:
                    self._pipes.scheduler.post(self._drained.wake_all)
        return AGAIN

    def _over(self) -> int:
        if self.descriptor >= 0:
            self._pipes.scheduler.post(self._ended)
        return OVER

    def _ended(self) -> None:
        self._drained.wake_all()
        self.on_end()


class Opening:
    """A fifo that can be opened to be written to once somebody reads it."""

    def __init__(self, pipes: Pipes, name: bytes) -> None:
        self._pipes = pipes
        self._name = name
        self._waiting = WaitQueue(pipes.scheduler)
        self._opened = -1
        self._error: OSError | None = None
        self._given_up = False
        self.descriptor = -1

    def wait(self) -> int:
        """Wait until it is open; the descriptor.  Raises OSError."""
        self._pipes.poller.attend(self)
        try:
            while self._opened < 0 and self._error is None:
                self._waiting.wait()
        except BaseException:
            self.close()
            raise
        if self._error is not None:
            raise self._error
        opened, self._opened = self._opened, -1
        return opened

    def close(self) -> None:
        """It is wanted no more."""
        self._given_up = True
        if self._opened >= 0:
            os.close(self._opened)
            self._opened = -1

    def ready(self) -> int:
        """Try to open it."""
        if self._given_up:
            return OVER
        try:
            opened = os.open(self._name, os.O_WRONLY | OPENED)
        except OSError as failure:
            if failure.errno == errno.ENXIO:
                return LATER
            self._pipes.scheduler.post(partial(self._over, -1, failure))
        else:
            self._pipes.scheduler.post(partial(self._over, opened, None))
        return OVER

    def _over(self, opened: int, error: OSError | None) -> None:
        if self._given_up and opened >= 0:
            os.close(opened)
            return
        self._opened, self._error = opened, error
        self._waiting.wake_all()
