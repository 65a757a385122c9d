"""The thread that reads and writes files that may block: pipes of programs, fifos, terminals, devices, sockets.

There is one per kernel.  It performs only non-blocking operations and waits by ``epoll`` for the next possible one, so
that one thread serves any number of files.  The result of ``ready`` tells when ``ready`` is to be called again.  The
thread starts with the first file and ends after some seconds without one; it is a daemon thread.
"""

from __future__ import annotations

import logging
import os
import select
import threading
import time
from collections import deque
from contextlib import suppress
from typing import Final, Protocol

log = logging.getLogger("urbihw.kernel")

READ: Final = select.EPOLLIN
WRITE: Final = select.EPOLLOUT
NOTHING: Final = 0
"""Wait for the next call of ``schedule``."""
AGAIN: Final = -1
"""Call again at once, after the other files had their turn."""
LATER: Final = -2
"""Call again after ``RETRY_PERIOD_S``, because the operating system reports no event for this file."""
OVER: Final = -3
"""The file is finished and its descriptor closed."""

RETRY_PERIOD_S: Final = 0.05
"""Interval in seconds between attempts on files without events."""
IDLE_TIMEOUT_S: Final = 5.0
"""Idle time in seconds after which the thread ends."""


class Watched(Protocol):
    """A file that the poller serves.

    Attributes:
        descriptor: descriptor of the open file, which the thread closes at the end; -1 for none.
    """

    descriptor: int

    def ready(self) -> int:
        """In the thread: do what is possible without blocking.  Returns READ, WRITE, NOTHING, AGAIN, LATER or OVER."""
        ...


class Poller:
    """The thread, and the files that it serves."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._asked: deque[Watched] = deque()
        self._bell = -1
        """An eventfd that wakes the thread; -1 while there is no thread."""
        self._epoll: select.epoll
        self._known: dict[int, Watched] = {}
        """Descriptor -> file that waits for an event of the operating system, or for ``schedule``."""
        self._later: dict[Watched, None] = {}
        self._next_try = 0.0

    def schedule(self, one: Watched) -> None:
        """From any thread: have ``one.ready()`` called soon."""
        with self._lock:
            self._asked.append(one)
            if self._bell < 0:
                self._bell = os.eventfd(1, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
                threading.Thread(target=self._serve, name="urbihw-files", daemon=True).start()
            elif len(self._asked) == 1:
                os.eventfd_write(self._bell, 1)

    # ---------------------------------------------------------------- the thread

    def _serve(self) -> None:
        with select.epoll() as epoll:
            self._epoll = epoll
            epoll.register(self._bell, READ)
            while self._serve_ready():
                pass

    def _serve_ready(self) -> bool:
        """Serve all ready files once; returns whether there may be more to do."""
        timeout = 0.0 if self._asked else RETRY_PERIOD_S if self._later else IDLE_TIMEOUT_S
        events = self._epoll.poll(timeout)
        with self._lock:
            with suppress(BlockingIOError):
                os.eventfd_read(self._bell)
            asked, self._asked = self._asked, deque()
            if not (events or asked or self._later or self._known):
                os.close(self._bell)
                self._bell = -1
                return False
        due = dict.fromkeys(asked)
        due.update((self._known[descriptor], None) for descriptor, _ in events if descriptor in self._known)
        now = time.monotonic()
        if now >= self._next_try:
            self._next_try = now + RETRY_PERIOD_S
            due.update(self._later)
            self._later.clear()
        for one in due:
            self._serve_one(one)
        return True

    def _serve_one(self, one: Watched) -> None:
        try:
            wants = one.ready()
        except Exception as error:
            log.error("error while attending to a file: %s: %s", type(error).__name__, error)
            wants = OVER
        if wants == AGAIN:
            with self._lock:
                self._asked.append(one)
        elif wants == LATER:
            self._later[one] = None
        elif wants == OVER:
            self._close(one)
        elif wants != NOTHING:
            self._wait(one, wants)

    def _wait(self, one: Watched, wants: int) -> None:
        """Have ``ready`` called at the next event of the operating system; some devices never have one."""
        descriptor = one.descriptor
        try:
            if descriptor in self._known:
                self._epoll.modify(descriptor, wants | select.EPOLLONESHOT)
            else:
                self._epoll.register(descriptor, wants | select.EPOLLONESHOT)
                self._known[descriptor] = one
        except PermissionError:
            self._later[one] = None

    def _close(self, one: Watched) -> None:
        descriptor, one.descriptor = one.descriptor, -1
        if descriptor >= 0:
            if self._known.pop(descriptor, None) is not None:
                with suppress(OSError):
                    self._epoll.unregister(descriptor)
            os.close(descriptor)
