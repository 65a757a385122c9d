"""The thread that reads and writes what may let wait: pipes of programs, fifos, terminals, devices.

There is one for each kernel.  It does only what can be done at once and asks the operating system (``epoll``) when more
can be done, so that one thread serves any number of files.  What it attends to says by what ``ready`` returns when it
is to be called again.  The thread begins with the first piece of work and ends when there has been none for a while; it
keeps nobody from ending the process.
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
"""Wait until somebody asks for attention."""
AGAIN: Final = -1
"""More can be done at once, after the others had their turn."""
LATER: Final = -2
"""Try again after ``PERIOD``: nothing tells when."""
OVER: Final = -3
"""There is nothing more to do: the descriptor is closed."""

PERIOD: Final = 0.05
"""Seconds between two tries of what nothing tells of."""
REST: Final = 5.0
"""Seconds without work after which the thread ends."""


class Watched(Protocol):
    """A file with something to do.

    Attributes:
        descriptor: of the open file, which the thread closes in the end; -1 for none.
    """

    descriptor: int

    def ready(self) -> int:
        """In the thread: do what can be done without waiting.  READ, WRITE, NOTHING, AGAIN, LATER or OVER."""
        ...


class Poller:
    """The thread, and what it attends to."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._asked: deque[Watched] = deque()
        self._bell = -1
        """An eventfd that ends the waiting of the thread; -1 while there is no thread."""
        self._epoll: select.epoll
        self._known: dict[int, Watched] = {}
        """By descriptor: what waits for the operating system, or for somebody to ask."""
        self._later: dict[Watched, None] = {}
        self._next_try = 0.0

    def attend(self, one: Watched) -> None:
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
            while self._turn():
                pass

    def _turn(self) -> bool:
        """Attend once to all that is ready; whether there may be more to do."""
        timeout = 0.0 if self._asked else PERIOD if self._later else REST
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
            self._next_try = now + PERIOD
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
        """Have ``ready`` called once when the operating system says so; of some devices it never does."""
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
