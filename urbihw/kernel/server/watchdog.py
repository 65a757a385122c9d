"""The thread that looks on while the scheduler is busy, and what it does to a job that harms the others.

It makes ``run`` come up for air, so that an endless loop of ``;`` does not starve the sockets.  With bounds,

- a job that holds the interpreter gets an error, which it may catch; if it holds on all the same it is ended;
- so does a job that takes all memory (see ``memory``).

The thread cannot do that itself.  It sends the scheduler's thread a signal, whose handler arms the ``Breaker``.  It is
SIGURG, because that is ignored by default: one that comes when the handler is gone harms nobody.  What runs outside any
job, and a long built-in function, cannot be broken into; it is named in the log.

The thread is not woken for each run, which would cost more than a short command does: it looks from time to time, and
rests only when nothing has run for a while.
"""

from __future__ import annotations

import contextlib
import enum
import logging
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import Any, Final

from urbihw.kernel.lobby.lobby import Lobby, lobby_of
from urbihw.kernel.sched.breaker import DEEPER
from urbihw.kernel.sched.errors import HeldTooLong
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.signals import Interrupted, JobKilled, Signal
from urbihw.kernel.server.bounds import Bounds
from urbihw.kernel.server.memory import Memory, Resident, end_all

log = logging.getLogger("urbihw.kernel")

AIR: Final = 0.004
"""Seconds of uninterrupted work after which the sockets get a turn, once the watchdog looks closely."""
CALM: Final = 0.02
"""Seconds between two looks of the watchdog while all runs are short."""
REST: Final = 1.0
"""Seconds without a run after which the watchdog rests."""
HELD: Final = 1.0
"""Seconds after which a job that does not yield is named in the log."""
GRACE: Final = 1.0
"""Seconds that a job may hold the interpreter on after an error that told it so."""
MOST_HOLDS: Final = 3
MEMORY: Final = 30.0
"""Seconds in which a connection must not hold the interpreter as often as that: then all that it runs is ended."""
AGAIN: Final = 0.02
"""Seconds after which a signal that had no effect is sent again."""
SIGNAL: Final = signal.SIGURG


class _Harm(enum.Enum):
    """What the thread wants done to the running job."""

    HOLDS = "an error: it holds the interpreter"
    HOLDS_ON = "the end: it still does"
    GROWS = "an error or the end, as the account of the memory says"
    AGAIN = "what it was to get, and has not got yet"


class Watchdog:
    """To be made in the thread of the scheduler; only in the main one jobs can be broken into."""

    def __init__(self, scheduler: Scheduler, bounds: Bounds) -> None:
        self._scheduler = scheduler
        self._hold_limit = bounds.hold_limit
        self._resident = Resident()
        self.memory = Memory(scheduler, bounds.memory_limit, self._resident, time.monotonic) \
            if bounds.memory_limit else None
        self._main = threading.get_ident()
        self._count = 0
        """Beginnings and ends of runs so far: odd while one lasts."""
        self._wanted: tuple[int, _Harm] | None = None
        self._named = (0, "")
        self._rests = False
        self._wake = threading.Event()
        self._closed = False
        self._former: signal.Handlers | Callable[[int, FrameType | None], object] | int | None = None
        self._breaks = threading.current_thread() is threading.main_thread()
        self._held: list[tuple[Lobby, float]] = []
        """Who held the interpreter lately, and when."""
        self._former_hook = sys.unraisablehook
        if self._breaks:
            self._former = signal.signal(SIGNAL, self._handle)
            sys.unraisablehook = self._not_raised
        self._thread = threading.Thread(target=self._watch, name="urbihw-watchdog", daemon=True)
        self._thread.start()

    def begin(self) -> None:
        """The scheduler begins to run."""
        self._count += 1
        if self._rests:
            self._wake.set()

    def end(self) -> None:
        """The scheduler is idle."""
        self._count += 1

    def close(self) -> None:
        """End the thread."""
        if self._closed:
            return
        self._closed = True
        self._wake.set()
        self._thread.join()
        self._resident.close()
        if self._breaks:
            signal.signal(SIGNAL, self._former)
            sys.unraisablehook = self._former_hook

    def _not_raised(self, unraisable: Any) -> None:
        """Python cannot raise an error in a finalizer: that of a program which is too deep in calls, or which is being
        ended there, is nobody's business, and its traceback not for the log."""
        if not isinstance(unraisable.exc_value, RecursionError | HeldTooLong | Signal):
            self._former_hook(unraisable)

    # ---------------------------------------------------------------- the thread

    def _watch(self) -> None:
        """Look, sleep, look.  What is found busy twice is interrupted, even if it is another run by then."""
        last = _Look(0, 0.0)
        while not self._closed:
            busy = self._count % 2 == 1
            look = last if last.count == self._count else _Look(self._count, time.monotonic())
            if busy and last.count % 2:
                self._interrupt(look)
            elif not busy and time.monotonic() - look.began > REST:
                self._rest(look)
            if self.memory is not None and self.memory.seen() and busy:
                self._want(look, _Harm.GROWS)
            last = look
            time.sleep(AIR if busy else CALM)

    def _interrupt(self, look: _Look) -> None:
        """Interrupt a run.  It goes on to the end of the present job's turn, so what lasts from now on is that turn."""
        now = time.monotonic()
        if not look.interrupted:
            look.interrupted = now
            self._scheduler.interrupt()
            return
        held = now - look.interrupted
        limit = self._hold_limit
        if not look.named and held > (min(HELD, limit) or HELD):
            look.named = True
            self._name(min(HELD, limit) or HELD)
        if limit and held > limit:
            if not look.broken:
                self._want(look, _Harm.HOLDS)
                look.broken = now
            elif self._wanted is not None or self._scheduler.breaker.armed():
                if now - look.broken > AGAIN:
                    self._want(look, _Harm.AGAIN if self._wanted is None else self._wanted[1])
                    look.broken = now
            elif now - look.broken > GRACE:
                self._want(look, _Harm.HOLDS_ON)
                look.broken = now

    def _name(self, seconds: float) -> None:
        """Name the running job in the log, once."""
        job = self._scheduler.current
        named = (id(job), (job.name if job is not None else "") or "?")
        if named == self._named and job is not None:
            return
        self._named = named
        frame = sys._current_frames().get(self._main)
        where = "" if frame is None else self._scheduler.place(frame)
        log.warning("job %s holds the interpreter for more than %s%s", named[1],
                    "a second" if seconds == 1 else f"{seconds:g} s", where)

    def _want(self, look: _Look, harm: _Harm) -> None:
        if self._breaks:
            self._wanted = (look.count, harm)
            with contextlib.suppress(ProcessLookupError):
                signal.pthread_kill(self._main, SIGNAL)

    def _rest(self, look: _Look) -> None:
        """Wait until something runs."""
        self._wake.clear()
        self._rests = True
        if self._count == look.count and not self._closed:
            self._wake.wait()
        self._rests = False

    # ---------------------------------------------------------------- the thread of the scheduler

    def _handle(self, number: int, frame: FrameType | None) -> None:
        """The signal: break into the running job, if it is still that turn.

        The job may stand where no call fits on the stack; then this fails, the job gets the error, and the thread sends
        the signal again.
        """
        usual = sys.getrecursionlimit()
        sys.setrecursionlimit(usual + DEEPER)
        try:
            self._break(frame)
        finally:
            sys.setrecursionlimit(usual)

    def _break(self, frame: FrameType | None) -> None:
        wanted, self._wanted = self._wanted, None
        job = self._scheduler.current
        if wanted is None or wanted[0] != self._count or job is None:
            return
        if wanted[1] is _Harm.AGAIN:
            self._scheduler.breaker.again(frame)
            return
        error = self._error(wanted[1], job)
        if error is not None:
            self._scheduler.breaker.break_in(frame, error)

    def _error(self, harm: _Harm, job: Job) -> BaseException | None:
        """What to leave the job by."""
        if harm is _Harm.HOLDS:
            self._remember(job)
            return HeldTooLong(f"held the interpreter for more than {self._hold_limit:g} s: give way with ';' or sleep")
        if harm is _Harm.HOLDS_ON:
            log.warning("job %s is ended: it held the interpreter on", job.name)
            self._tell(job, f"!!! job {job.name} is ended: it held the interpreter on")
            return leaving(job)
        assert self.memory is not None
        if not self.memory.exceeded(job):
            return None
        return leaving(job) if self.memory.ends() else MemoryError()

    def _remember(self, job: Job) -> None:
        """Who holds the interpreter again and again (by an ``at``, say) keeps nothing that could do so once more."""
        lobby, now = lobby_of(job), time.monotonic()
        if lobby is None:
            return
        self._held = [(who, when) for who, when in self._held if now - when < MEMORY] + [(lobby, now)]
        if sum(who is lobby for who, _ in self._held) >= MOST_HOLDS:
            self._held = [(who, when) for who, when in self._held if who is not lobby]
            log.warning("all jobs of %s are ended: they held the interpreter %d times", lobby.tag.tag.name, MOST_HOLDS)
            told = f"!!! all that this connection runs is ended: it held the interpreter {MOST_HOLDS} times"
            self._scheduler.post(lambda: end_all(lobby, told))

    def _tell(self, job: Job, text: str) -> None:
        lobby = lobby_of(job)
        if lobby is not None:
            self._scheduler.post(lambda: lobby.output.line(text, "error"))


def leaving(job: Job) -> Signal:
    """What ends the running job; if it is the main one of a connection, that of its statement in the foreground.

    The connection is told why by who ends it.
    """
    lobby = job.context
    return Interrupted(told=True) if isinstance(lobby, Lobby) and lobby.shell.is_running() else JobKilled()


class _Look:
    """What the watchdog saw: the count, when it saw it first, and what it did about it and when."""

    __slots__ = ("began", "broken", "count", "interrupted", "named")

    def __init__(self, count: int, began: float) -> None:
        self.count = count
        self.began = began
        self.interrupted = 0.0
        self.broken = 0.0
        self.named = False
