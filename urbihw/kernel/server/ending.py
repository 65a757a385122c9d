"""How a server's process ends when it was told to, whatever its programs do meanwhile.

An orderly end needs the scheduler's thread.  If that does not get to it (a program holds it in a long built-in
function, or is so deep in calls that a signal handler fails), ``LastResort`` ends the process from a thread of its own.
It hears of signals by Python's wake-up descriptor, which is written to at once, whatever the main thread does.  Only a
built-in function that lets no thread run (a regular expression that tries without end) defers even that; then it takes
SIGKILL.
"""

from __future__ import annotations

import contextlib
import logging
import os
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Collection
from typing import Final, NoReturn

log = logging.getLogger("urbihw.kernel")

PATIENCE: Final = 1.5
"""Seconds after a signal in which the process must have ended, or have told how long it needs."""
TELLING: Final = 0.2
"""Seconds for what is said last: somebody may hold the log."""


class LastResort:
    """Ends the process some seconds after a signal that means its end."""

    def __init__(self, signals: Collection[int], before: Callable[[], object] = lambda: None) -> None:
        """``before`` is what must be done all the same, in a thread of its own."""
        self._signals = signals
        self._before = before
        self._due = 0.0
        self._allowed = 0.0
        self._inner, self._outer = socket.socketpair()
        self._former = -1
        self._thread = threading.Thread(target=self._watch, name="urbihw-last-resort", daemon=True)

    def install(self) -> None:
        """Begin, in the main thread; who hears of signals by the wake-up descriptor goes on hearing of them."""
        self._outer.setblocking(False)
        self._former = signal.set_wakeup_fd(self._outer.fileno(), warn_on_full_buffer=False)
        self._thread.start()

    def allow(self, seconds: float) -> None:
        """The end has begun, or goes on: it may take so long from now."""
        self._allowed = time.monotonic() + seconds
        with contextlib.suppress(OSError):
            self._outer.send(b"\0")  # the thread may wait for something sooner

    def uninstall(self) -> None:
        """All is well; in the main thread, and twice is fine."""
        if self._thread.is_alive():
            signal.set_wakeup_fd(self._former)
            self._outer.close()
            self._thread.join()
        self._inner.close()
        self._outer.close()

    def _watch(self) -> None:
        """Read the numbers of the signals, until one of them was not obeyed in time."""
        while True:
            wait = max(0.0, (self._allowed or self._due) - time.monotonic()) if self._due else None
            if select.select([self._inner], [], [], wait)[0]:
                numbers = self._inner.recv(256)
                if not numbers:
                    return
                if any(numbers):
                    self._pass_on(numbers)
                if not self._due and any(number in self._signals for number in numbers):
                    self._due = time.monotonic() + PATIENCE
            elif time.monotonic() >= (self._allowed or self._due):
                self._end()

    def _pass_on(self, numbers: bytes) -> None:
        if self._former >= 0:
            with contextlib.suppress(OSError):
                os.write(self._former, numbers)

    def _end(self) -> NoReturn:
        def tell() -> None:
            log.error("ended at once: a program, or what waits for it, kept this from ending in order")
            sys.stderr.flush()

        try:
            self._before()
        finally:
            try:
                telling = threading.Thread(target=tell, daemon=True)
                telling.start()  # which may fail: programs may have taken all threads
                telling.join(TELLING)
            finally:
                os._exit(0)


def leave(code: int) -> NoReturn:
    """End the process at once with an exit code, when all is done.

    The interpreter would free all objects one by one, which takes seconds when programs have made many.
    """
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    logging.shutdown()
    os._exit(code)
