"""Byte streams with blocking peers, for ``process``, ``stream`` and ``file``: the thread of the ``poller`` reads and
writes, the jobs wait.

The thread reports to the kernel only by ``scheduler.post``.  It reads ahead of the programs up to a limit; then it
waits until they have read some bytes, and the writing process waits like with any pipe.  The bytes are processed by the
job that reads them.
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
from urbihw.kernel.stdlib.poller import AGAIN, LATER, NOTHING, OVER, READ, WRITE, Poller
from urbihw.kernel.stdlib.worker_thread import WorkerThread

CHUNK_SIZE: Final = 65536
"""Number of bytes read or written in one operation; each source may always hold as many unread bytes."""
MAX_BACKLOG_SIZE: Final = 16 * 1024 * 1024
"""Maximum number of unread bytes from all sources of a connection; also the maximum of unwritten bytes of each sink."""
MAX_LINE_LENGTH: Final = 1024 * 1024
"""Maximum length of a line in bytes; a longer line is delivered in pieces."""
OPEN_FLAGS: Final = os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY
"""Flags for opening special files, which may block."""


class Pipes:
    """State shared by the pipes of a kernel."""

    def __init__(self, world: World) -> None:
        self.scheduler = world.scheduler
        self.poller = Poller()
        self.starter = WorkerThread(world, lambda: None)
        """Starts programs one after the other: each start blocks all threads for a moment."""
        self._backlogs: WeakKeyDictionary[Holdings, Backlog] = WeakKeyDictionary()

    def backlog(self, holdings: Holdings) -> Backlog:
        """The backlog of a connection."""
        found = self._backlogs.get(holdings)
        if found is None:
            found = self._backlogs[holdings] = Backlog(self.poller, MAX_BACKLOG_SIZE)
        return found


def pipes_of(world: World) -> Pipes:
    """The pipes of a world."""
    if not world.has_part(Pipes):
        world.install_part(Pipes(world))
    return world.part(Pipes)


class Backlog:
    """The number of unread bytes of some sources, with a limit."""

    def __init__(self, poller: Poller, limit: int) -> None:
        self._poller = poller
        self._limit = limit
        self._lock = threading.Lock()
        self._size = 0
        self._paused: dict[PipeSource, None] = {}
        self.gathered = 0
        """Number of bytes held by jobs that read whole devices and fifos; used in the kernel's thread only."""

    def has_room(self, source: PipeSource) -> bool:
        """In the thread: whether a source may continue to read.  If not, it is called again when there is room."""
        with self._lock:
            if source.unread < source.allowed or self._size < self._limit:
                return True
            self._paused[source] = None
            return False

    def add_bytes(self, source: PipeSource, size: int) -> None:
        """In the thread: count the bytes that a source has read."""
        with self._lock:
            source.unread += size
            self._size += size

    def release_bytes(self, source: PipeSource, size: int) -> None:
        """In the kernel: count the bytes that a program has taken from a source, or raise the source's own limit."""
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
            self._poller.schedule(one)


class PipeSource:
    """The output of a program: the thread reads it, jobs take it."""

    def __init__(self, pipes: Pipes) -> None:
        self._pipes = pipes
        self._waiting = WaitQueue(pipes.scheduler)
        self._data = bytearray()
        self.ended = False
        self.on_end: Callable[[], None] = lambda: None
        self.allowed = CHUNK_SIZE
        """Number of unread bytes that this source may hold in any case."""
        self.unread = 0
        """Number of unread bytes; belongs to the backlog."""
        # used by the thread; below the lock, by both sides
        self.descriptor = -1
        self._backlog: Backlog
        self._waits_for_writer = False
        self._lock = threading.Lock()
        self._come: deque[bytes] = deque()
        self._closed = False

    def __len__(self) -> int:
        """The number of unread bytes."""
        return len(self._data)

    def start(self, descriptor: int, backlog: Backlog, waits_for_writer: bool = False) -> None:
        """Start to read an open non-blocking file; the thread closes it at the end.

        ``waits_for_writer``: an end of file of a fifo counts only after a first writer has opened it.
        """
        self.descriptor, self._backlog, self._waits_for_writer = descriptor, backlog, waits_for_writer
        self._pipes.poller.schedule(self)

    def finish(self) -> None:
        """Mark the source as ended: no more bytes follow."""
        if not self.ended:
            self.ended = True
            self.on_end()
        self._waiting.wake_all()

    # ---------------------------------------------------------------- for jobs

    def read_byte(self) -> bytes:
        """Wait for the next byte and return it; empty at the end."""
        while not self._data and not self.ended:
            self._waiting.wait()
        return self._take_bytes(1)

    def read_some(self) -> bytes:
        """Wait for bytes and return all that are there; empty at the end."""
        while not self._data and not self.ended:
            self._waiting.wait()
        return self._take_bytes(len(self._data))

    def read_line(self) -> bytes:
        """Wait for the rest of the line and return it with its line end; empty at the end.  A line above the limit is
        returned in pieces.
        """
        searched = 0
        while (at := self._data.find(b"\n", searched)) < 0 and not self.ended and len(self._data) < MAX_LINE_LENGTH:
            searched = len(self._data)
            if searched >= CHUNK_SIZE and self.allowed == CHUNK_SIZE:
                self.allowed = MAX_LINE_LENGTH
                self._backlog.release_bytes(self, 0)
            self._waiting.wait()
            searched = min(searched, len(self._data))  # another job may have taken some bytes
        return self._take_bytes(min(at + 1 or len(self._data), MAX_LINE_LENGTH))

    def close(self) -> None:
        """Stop reading: unread bytes are discarded, and the operating system reports the closed pipe to the writer."""
        self._closed = True
        self.finish()
        self._take_bytes(len(self._data))
        if self.descriptor >= 0:
            self._pipes.poller.schedule(self)

    def _take_bytes(self, size: int) -> bytes:
        taken = bytes(self._data[:size])
        del self._data[:size]
        if taken:
            self._backlog.release_bytes(self, len(taken))
        return taken

    def _arrived(self) -> None:
        """Wake the waiting jobs because the thread has read bytes."""
        with self._lock:
            come, self._come = self._come, deque()
        for piece in come:
            self._data += piece
        if self._closed:
            self._take_bytes(len(self._data))
        if not come[-1]:
            self.finish()
        self._waiting.wake_all()

    # ---------------------------------------------------------------- for the thread

    def ready(self) -> int:
        """Read more bytes if there is room."""
        if self._closed:
            return OVER
        if self._waits_for_writer:
            self._waits_for_writer = False
            return READ
        if not self._backlog.has_room(self):
            return NOTHING
        try:
            data = os.read(self.descriptor, CHUNK_SIZE)
        except BlockingIOError:
            return READ
        except OSError:  # the other side of a terminal or a device is closed
            data = b""
        self._backlog.add_bytes(self, len(data))
        with self._lock:
            self._come.append(data)
            told = len(self._come) > 1
        if not told:
            self._pipes.scheduler.post(self._arrived)
        return AGAIN if data else OVER


class PipeSink:
    """The input of a program: bytes are queued until it runs, then written in the thread."""

    def __init__(self, pipes: Pipes) -> None:
        self._pipes = pipes
        self._drained = WaitQueue(pipes.scheduler)
        self.on_end: Callable[[], None] = lambda: None
        """Called in the kernel's thread when the file is closed."""
        self.descriptor = -1
        # used by both sides, under the lock
        self._lock = threading.Lock()
        self._pieces: deque[memoryview] = deque()
        self._size = 0
        self._closing = False
        self._discarding = False
        """Whether the reader is gone: further bytes are discarded."""

    def start(self, descriptor: int) -> None:
        """Start to write to an open non-blocking file; the thread closes it at the end."""
        self.descriptor = descriptor
        self._pipes.poller.schedule(self)

    def write(self, data: bytes) -> None:
        """Queue bytes for writing.  Raises OSError if too many bytes are waiting."""
        if not data:
            return
        with self._lock:
            if self._discarding:
                return
            if self._size > MAX_BACKLOG_SIZE:
                raise OSError(f"the other side does not read: {self._size} bytes wait for it")
            self._size += len(data)
            self._pieces.append(memoryview(data))
        self._schedule()

    def flush(self) -> None:
        """No operation: the thread writes as soon as possible."""

    def close(self) -> None:
        """Close the sink after the queued bytes are written."""
        self._closing = True
        self._schedule()

    def drop(self) -> None:
        """Close the sink and discard the queued bytes."""
        self._discard_unsent()
        self.close()

    def wait_until_written(self) -> None:
        """Wait until all queued bytes are written, or the reader is gone."""
        while self._size:
            self._drained.wait()

    def _schedule(self) -> None:
        if self.descriptor >= 0:
            self._pipes.poller.schedule(self)

    def _discard_unsent(self) -> None:
        with self._lock:
            self._discarding = True
            self._pieces.clear()
            self._size = 0

    # ---------------------------------------------------------------- for the thread

    def ready(self) -> int:
        """Write more bytes when the pipe takes some."""
        with self._lock:
            piece = self._pieces[0] if self._pieces else None
        if piece is None:
            return self._over() if self._closing else NOTHING
        try:
            written = os.write(self.descriptor, piece[:CHUNK_SIZE])
        except BlockingIOError:
            return WRITE
        except OSError:  # the program has closed its input
            self._discard_unsent()
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
    """Opens a fifo for writing as soon as it has a reader."""

    def __init__(self, pipes: Pipes, name: bytes) -> None:
        self._pipes = pipes
        self._name = name
        self._waiting = WaitQueue(pipes.scheduler)
        self._opened = -1
        self._error: OSError | None = None
        self._given_up = False
        self.descriptor = -1

    def wait(self) -> int:
        """Wait until the fifo is open; returns its descriptor.  Raises OSError."""
        self._pipes.poller.schedule(self)
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
        """Cancel the attempt to open the pipe."""
        self._given_up = True
        if self._opened >= 0:
            os.close(self._opened)
            self._opened = -1

    def ready(self) -> int:
        """Try to open the fifo."""
        if self._given_up:
            return OVER
        try:
            opened = os.open(self._name, os.O_WRONLY | OPEN_FLAGS)
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
