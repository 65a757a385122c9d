"""The handler of Ctrl-C and SIGTERM (manual, "urbi": quitting).

With an interactive lobby the first Ctrl-C kills its foreground job and drops the statements queued behind it; a second
one within 1.5 s shuts the server down.  Without an interactive lobby the first Ctrl-C shuts the server down.  SIGTERM
always does.
"""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from types import FrameType

from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.recursion import set_recursion_limit
from urbihw.kernel.sched.breaker import EXTRA_CALLS
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.signals import Interrupted, JobKilled

SECOND_INTERRUPT_S = 1.5
"""Seconds within which a second Ctrl-C shuts the server down."""
GRACE_S = 0.25
"""Seconds for which a background job may hold the interpreter after Ctrl-C."""


class Interrupter:
    """The handler of SIGINT and SIGTERM.  It can also be called from any thread, for a Ctrl-C read as a key.

    Only the signal can interrupt a job that never yields (an endless ``|`` loop).
    """

    def __init__(
        self,
        scheduler: Scheduler,
        shutdown: Callable[[], None],
        lobby: Lobby | None = None,
        now: Callable[[], float] = time.monotonic,
        *,
        second_is_fatal: bool = False,
    ) -> None:
        """``shutdown`` is called between two rounds of the scheduler.  ``lobby`` is the interactive lobby, None if
        there is none.  ``now`` returns the time in seconds.

        ``second_is_fatal``: after a shutdown has begun, the next SIGINT ends the process at once.
        """
        self.lobby = lobby
        self._scheduler = scheduler
        self._shutdown = shutdown
        self._breaker = scheduler.breaker
        self._now = now
        self._last = -math.inf
        self._second_is_fatal = second_is_fatal
        self.is_ending = False
        """Whether a signal has asked for the end of the process, and not of a program only."""

    def __call__(self, number: int = signal.SIGINT, frame: FrameType | None = None) -> None:
        """Handle SIGINT or SIGTERM; ``frame`` is the Python frame that the signal interrupted, None for a key."""
        if number == signal.SIGTERM:
            self.lobby = None
        usual = set_recursion_limit(sys.getrecursionlimit() + EXTRA_CALLS)
        try:
            self._interrupted(frame)
        finally:
            sys.setrecursionlimit(usual)

    def _interrupted(self, frame: FrameType | None) -> None:
        now = self._now()
        again = now - self._last < SECOND_INTERRUPT_S
        self._last = now
        if self.lobby is None or again:
            self._end(frame)
        else:
            self._kill(self.lobby, frame)

    def _kill(self, lobby: Lobby, frame: FrameType | None) -> None:
        shell = lobby.shell
        if frame is not None and shell.is_running():
            self._breaker.break_in(frame, Interrupted())
            # For a statement that catches this.  What is typed at once may be there first.
            self._scheduler.post(partial(shell.interrupt, shell.turn))
            return
        if frame is not None:
            self._breaker.break_in(frame, JobKilled(), GRACE_S)
        self._scheduler.post(shell.interrupt)

    def _end(self, frame: FrameType | None) -> None:
        self.is_ending = True
        if self._second_is_fatal and threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        if frame is not None:
            self._breaker.break_in(frame, JobKilled(), GRACE_S)
        self._scheduler.post(self._shut_down)

    def _shut_down(self) -> None:
        if self.lobby is not None:
            self.lobby.output.line("!!! received interruption, shutting down.", "error")
        self._shutdown()
