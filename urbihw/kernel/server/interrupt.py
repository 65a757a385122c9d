"""What Ctrl-C does (manual, "urbi": quitting).

With an interactive lobby the first one kills its foreground job and drops the statements that wait behind it; another
within 1.5 s shuts down.  Without, the first shuts down.  Once a shutdown was asked for, the next one ends the process.
"""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType

from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.breaker import DEEPER
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.signals import Interrupted, JobKilled

TWICE = 1.5
"""Seconds within which a second interruption means to shut down."""
GRACE = 0.25
"""Seconds that a job which is not in the foreground may hold the interpreter after an interruption."""


class Interrupter:
    """The handler of SIGINT; may also be called by hand, from any thread, for a Ctrl-C that came as a key.

    A job that never yields (an endless ``|`` loop) is broken into only when it is the signal that comes.
    """

    def __init__(
        self,
        scheduler: Scheduler,
        shutdown: Callable[[], None],
        lobby: Lobby | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """``shutdown`` is called between two rounds; ``lobby`` is the interactive one, None if there is none; ``now``
        tells how long the user took, in seconds."""
        self.lobby = lobby
        self._scheduler = scheduler
        self._shutdown = shutdown
        self._breaker = scheduler.breaker
        self._now = now
        self._last = -math.inf
        self._former: signal.Handlers | Callable[[int, FrameType | None], object] | int | None = None
        self._installed = False

    def install(self) -> None:
        """Become the handler of SIGINT; in the main thread only."""
        self._former = signal.signal(signal.SIGINT, self)
        self._installed = True

    def uninstall(self) -> None:
        """Put the former handler back; in the main thread only."""
        if self._installed:
            signal.signal(signal.SIGINT, self._former)
            self._installed = False

    def __call__(self, number: int = signal.SIGINT, frame: FrameType | None = None) -> None:
        """An interruption; ``frame`` is what the signal interrupted."""
        usual = sys.getrecursionlimit()
        sys.setrecursionlimit(usual + DEEPER)
        try:
            self._interrupted(frame)
        finally:
            sys.setrecursionlimit(usual)

    def _interrupted(self, frame: FrameType | None) -> None:
        now = self._now()
        again = now - self._last < TWICE
        self._last = now
        if self.lobby is None or again:
            self._end(frame)
        else:
            self._kill(self.lobby, frame)

    def _kill(self, lobby: Lobby, frame: FrameType | None) -> None:
        if frame is not None:
            if lobby.shell.is_running():
                self._breaker.break_in(frame, Interrupted())
            else:
                self._breaker.break_in(frame, JobKilled(), GRACE)
        self._scheduler.post(lobby.shell.interrupt)

    def _end(self, frame: FrameType | None) -> None:
        if self._installed and threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        if frame is not None:
            self._breaker.break_in(frame, JobKilled(), GRACE)
        self._scheduler.post(self._shut_down)

    def _shut_down(self) -> None:
        if self.lobby is not None:
            self.lobby.output.line("!!! received interruption, shutting down.", "error")
        self._shutdown()
