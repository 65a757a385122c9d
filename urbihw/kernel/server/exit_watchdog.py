"""Ends the process of a server in time after a signal, even while a program blocks the interpreter.

An orderly shutdown needs the scheduler's thread.  If that thread is not available (a program holds it in a long
built-in function, or is so deep in calls that the signal handler fails), ``ExitWatchdog`` ends the process from a
thread of its own.  It learns of signals from Python's wake-up descriptor, which is written at once, whatever the main
thread does.  Only a built-in function that never releases the GIL (a regular expression that backtracks without end)
defers even that; then only SIGKILL helps.
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

END_TIMEOUT_S: Final = 1.5
"""Seconds after a signal within which the process must end or call ``extend_deadline``."""
LOG_TIMEOUT_S: Final = 0.2
"""Maximum seconds to write the last log line: another thread may hold the lock of the log."""


class ExitWatchdog:
    """Ends the process when it has not ended by itself some seconds after a terminating signal."""

    def __init__(self, signals: Collection[int], before: Callable[[], object] = lambda: None) -> None:
        """``before`` is called in the thread of the watchdog before it ends the process."""
        self._signals = signals
        self._before = before
        self._due = 0.0
        self._allowed = 0.0
        self._inner, self._outer = socket.socketpair()
        self._former = -1
        self._thread = threading.Thread(target=self._watch, name="urbihw-last-resort", daemon=True)

    def install(self) -> None:
        """Start the watchdog; call this in the main thread.  A former wake-up descriptor still gets all signals."""
        self._outer.setblocking(False)
        self._former = signal.set_wakeup_fd(self._outer.fileno(), warn_on_full_buffer=False)
        self._thread.start()

    def extend_deadline(self, seconds: float) -> None:
        """The shutdown is making progress: let it take so many seconds from now."""
        self._allowed = time.monotonic() + seconds
        with contextlib.suppress(OSError):
            self._outer.send(b"\0")  # wake the thread, which may wait for an earlier deadline

    def uninstall(self) -> None:
        """Stop the watchdog; call this in the main thread.  A second call does nothing."""
        if self._thread.is_alive():
            signal.set_wakeup_fd(self._former)
            self._outer.close()
            self._thread.join()
        self._inner.close()
        self._outer.close()

    def _watch(self) -> None:
        """Read signal numbers until a terminating signal is not obeyed in time."""
        while True:
            wait = max(0.0, (self._allowed or self._due) - time.monotonic()) if self._due else None
            if select.select([self._inner], [], [], wait)[0]:
                numbers = self._inner.recv(256)
                if not numbers:
                    return
                if any(numbers):
                    self._pass_on(numbers)
                if not self._due and any(number in self._signals for number in numbers):
                    self._due = time.monotonic() + END_TIMEOUT_S
            elif time.monotonic() >= (self._allowed or self._due):
                self._end()

    def _pass_on(self, numbers: bytes) -> None:
        if self._former >= 0:
            with contextlib.suppress(OSError):
                os.write(self._former, numbers)

    def _end(self) -> NoReturn:
        def write_reason() -> None:
            log.error("ended at once: a program, or what waits for it, kept this from ending in order")
            sys.stderr.flush()

        try:
            self._before()
        finally:
            try:
                writer = threading.Thread(target=write_reason, daemon=True)
                writer.start()  # may fail: programs may have used up all threads
                writer.join(LOG_TIMEOUT_S)
            finally:
                os._exit(0)


def leave(code: int) -> NoReturn:
    """End the process at once with an exit code, after an orderly shutdown.

    An ordinary exit frees all objects one by one, which takes seconds when programs have created many.
    """
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    logging.shutdown()
    os._exit(code)
