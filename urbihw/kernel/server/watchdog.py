"""The thread that monitors the scheduler while it is busy, and interrupts jobs that harm others.

It makes ``run`` return from time to time, so that an endless loop of ``;`` does not starve the sockets.  With bounds,

- a job that holds the interpreter gets an error, which it can catch; if it goes on, it is ended.  What counts is the
  processor time of the scheduler's thread: on a loaded machine a short job takes long, and does no harm;
- so does a job that exhausts the memory (``memory``).

The thread cannot raise an error in another thread.  It sends the scheduler's thread a signal, whose handler arms the
``Breaker``.  The signal is SIGURG because that is ignored by default: one that arrives after the handler was removed
does no harm.  Code outside any job and a long built-in function cannot be interrupted; the log names them.

The thread is not woken for each run, which would cost more than a short command: it polls, and stops polling only when
nothing has run for a while.
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
from types import CodeType, FrameType
from typing import Any, Final

from urbihw.kernel.lobby.lobby import Lobby, lobby_of
from urbihw.kernel.recursion import set_recursion_limit
from urbihw.kernel.sched.breaker import EXTRA_CALLS
from urbihw.kernel.sched.errors import HeldTooLong
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.signals import Interrupted, JobKilled, JobSignal
from urbihw.kernel.server.bounds import Bounds
from urbihw.kernel.server.memory import MemoryAccount, ResidentMemory, end_all

log = logging.getLogger("urbihw.kernel")

MAX_RUN_S: Final = 0.004
"""Seconds of uninterrupted work after which the sockets get a turn; also the polling period during a long run."""
POLL_PERIOD_S: Final = 0.02
"""Seconds between two polls while all runs are short."""
IDLE_TIMEOUT_S: Final = 1.0
"""Seconds without a run after which the thread stops polling."""
LOG_HOLD_S: Final = 1.0
"""Seconds, by the clock, after which the log names a job that does not yield, where there is no limit."""
GRACE_SHARE: Final = 0.5
"""The time for which a job may go on holding the interpreter after it got the error, as a share of the limit."""
MAX_HOLDS: Final = 3
HOLD_WINDOW_S: Final = 30.0
"""A connection whose jobs hold the interpreter for the whole limit ``MAX_HOLDS`` times in so many seconds has all its
jobs ended."""
SHORTEST_HOLD_S: Final = 0.03
"""Many connections may each hold the interpreter with the first that they send: their time is halved for each other
connection that has got the error in ``HOLD_WINDOW_S``, down to this."""
SIGNAL_RETRY_S: Final = 0.02
"""Seconds after which a signal without effect is sent again."""
SIGNAL: Final = signal.SIGURG


class _Harm(enum.Enum):
    """The interruption that the thread requests for the running job."""

    HOLDS = "an error: it holds the interpreter"
    HOLDS_ON = "the end: it still does"
    GROWS = "an error or the end: the process has too much memory"
    AGAIN = "the same once more: the last signal had no effect"


class Watchdog:
    """Monitors one scheduler.  Create it in the scheduler's thread; jobs can be interrupted only if that is the main
    thread."""

    def __init__(self, scheduler: Scheduler, bounds: Bounds) -> None:
        self._scheduler = scheduler
        self.hold_limit = bounds.hold_limit
        """Seconds of processor time that a job may hold the interpreter; 0: no limit."""
        self._resident = ResidentMemory()
        self.memory = MemoryAccount(scheduler, bounds.memory_limit, self._resident, time.monotonic) \
            if bounds.memory_limit else None
        self._main = threading.get_ident()
        self._processor_clock = time.pthread_getcpuclockid(self._main)
        self._count = 0
        """Number of beginnings and ends of runs so far: odd during a run."""
        self._wanted: tuple[int, _Harm] | None = None
        self._handling = False
        """A signal is being handled, which takes long where the job's stack is deep."""
        self._named = (0, "")
        self._rests = False
        self._wake = threading.Event()
        self._closed = False
        self._former: signal.Handlers | Callable[[int, FrameType | None], object] | int | None = None
        self._breaks = threading.current_thread() is threading.main_thread()
        self._held: list[tuple[Lobby, float, bool]] = []
        """The lobbies whose jobs held the interpreter lately, the times, and whether it was for the whole limit."""
        self._former_hook = sys.unraisablehook
        if self._breaks:
            self._former = signal.signal(SIGNAL, self._handle_signal)
            sys.unraisablehook = self._filter_unraisable
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
        """End the thread that watches."""
        if self._closed:
            return
        self._closed = True
        self._wake.set()
        self._thread.join()
        self._resident.close()
        if self._breaks:
            signal.signal(SIGNAL, self._former)
            sys.unraisablehook = self._former_hook

    def _filter_unraisable(self, unraisable: Any) -> None:
        """Python cannot raise an error in a finalizer and logs a traceback.  Keep it out of the log if the error only
        means that the program is too deep in calls or is being ended."""
        if unraisable.exc_type is RecursionError:
            return  # where it comes from, there is no room for another call, as ``isinstance`` is one
        if not isinstance(unraisable.exc_value, HeldTooLong | JobSignal):
            self._former_hook(unraisable)

    # ---------------------------------------------------------------- the thread

    def _watch(self) -> None:
        """Poll the scheduler.  If it is busy in two polls in a row it is interrupted, even if that is another run by
        then."""
        last = _Observation(0, 0.0)
        while not self._closed:
            busy = self._count % 2 == 1
            look = last if last.count == self._count else _Observation(self._count, time.monotonic())
            if busy and last.count % 2:
                self._interrupt(look)
            elif not busy and time.monotonic() - look.began > IDLE_TIMEOUT_S:
                self._wait_for_run(look)
            if self.memory is not None and self.memory.is_over_limit() and busy:
                self._request_break(look, _Harm.GROWS)
            last = look
            time.sleep(MAX_RUN_S if busy else POLL_PERIOD_S)

    def _processor_time(self) -> float:
        """The processor time of the scheduler's thread, in seconds."""
        return time.clock_gettime(self._processor_clock)

    def _interrupt(self, look: _Observation) -> None:
        """Interrupt a run.  The run ends after the turn of the current job, so the time from now on is that of this
        turn."""
        now, busy = time.monotonic(), self._processor_time()
        if not look.interrupted:
            look.interrupted, look.began_busy = now, busy
            self._scheduler.interrupt()
            return
        limit = look.limit = look.limit or self._limit_of(self._scheduler.current)
        exceeds = limit > 0 and busy - look.began_busy > limit
        if not look.named and (exceeds or not limit and now - look.interrupted > LOG_HOLD_S):
            look.named = True
            self._log_holder(limit or LOG_HOLD_S)
        if exceeds:
            self._break_holder(look, now, busy)

    def _break_holder(self, look: _Observation, now: float, busy: float) -> None:
        """Interrupt the job that holds the interpreter, or see to it that this takes effect."""
        if not look.broken:
            harm = _Harm.HOLDS
        elif self._handling:
            look.broken, look.broken_busy = now, busy
            return
        elif self._wanted is not None or self._scheduler.breaker.armed():
            if now - look.broken <= SIGNAL_RETRY_S:
                return
            harm = _Harm.AGAIN if self._wanted is None else self._wanted[1]
        elif busy - look.broken_busy > GRACE_SHARE * look.limit:
            harm = _Harm.HOLDS_ON
        else:
            return
        self._request_break(look, harm)
        look.broken, look.broken_busy = now, busy

    def _limit_of(self, job: Job | None) -> float:
        """Seconds of processor time that a job may hold the interpreter, 0 for no limit.

        Others that hold it take nothing from a connection that has been served before and has not held it itself.
        """
        own, since = None if job is None else lobby_of(job), time.monotonic() - HOLD_WINDOW_S
        held = {who for who, when, _ in self._held if when >= since}
        if own is None or own.served and own not in held:
            return self.hold_limit
        others = held - {own}
        return max(self.hold_limit * 0.5 ** len(others), min(self.hold_limit, SHORTEST_HOLD_S))

    def _log_holder(self, seconds: float) -> None:
        """Write the name of the running job to the log, once."""
        job = self._scheduler.current
        named = (id(job), (job.name if job is not None else "") or "?")
        if named == self._named and job is not None:
            return
        self._named = named
        frame = sys._current_frames().get(self._main)
        where = "" if frame is None else self._scheduler.hooks.describe_frame(frame)
        log.warning("job %s holds the interpreter for more than %s%s", named[1],
                    "a second" if seconds == 1 else f"{seconds:g} s", where)

    def _request_break(self, look: _Observation, harm: _Harm) -> None:
        if self._breaks:
            self._wanted = (look.count, harm)
            with contextlib.suppress(ProcessLookupError):
                signal.pthread_kill(self._main, SIGNAL)

    def _wait_for_run(self, look: _Observation) -> None:
        """Wait until something runs."""
        self._wake.clear()
        self._rests = True
        if self._count == look.count and not self._closed:
            self._wake.wait()
        self._rests = False

    # ---------------------------------------------------------------- the thread of the scheduler

    def _handle_signal(self, number: int, frame: FrameType | None) -> None:
        """The signal handler: interrupt the running job if its turn has not ended.

        If the job's stack has no room for another call, the handler fails, the job gets that error, and the thread
        sends the signal again.  A signal that arrives meanwhile is ignored: handlers that interrupt each other would
        use up the stack of a process that gets too little time.
        """
        if self._handling:
            return
        usual = set_recursion_limit(sys.getrecursionlimit() + EXTRA_CALLS)
        self._handling = True
        try:
            self._break(frame)
        finally:
            self._handling = False
            sys.setrecursionlimit(usual)

    def _break(self, frame: FrameType | None) -> None:
        wanted, self._wanted = self._wanted, None
        job = self._scheduler.current
        if wanted is None or wanted[0] != self._count or job is None:
            return
        if wanted[1] is _Harm.AGAIN:
            self._scheduler.breaker.rearm(frame)
            return
        error = self._break_error(wanted[1], job, frame)
        if error is not None:
            self._scheduler.breaker.break_in(frame, error)

    def _break_error(self, harm: _Harm, job: Job, frame: FrameType | None) -> BaseException | None:
        """The exception to raise in the job; None for none."""
        if harm is _Harm.HOLDS:
            limit = self._limit_of(job)
            self._count_hold(job, frame, limit >= self.hold_limit)
            return HeldTooLong(f"held the interpreter for more than {limit:.2g} s: give way with ';' or sleep")
        if harm is _Harm.HOLDS_ON:
            log.warning("job %s is ended: it held the interpreter on", job.name)
            self._write_error(job, f"!!! job {job.name} is ended: it held the interpreter on")
            return end_signal(job)
        assert self.memory is not None
        if not self.memory.must_end(job):
            return None
        return end_signal(job) if self.memory.is_final() else MemoryError()

    def _count_hold(self, job: Job, frame: FrameType | None, whole: bool) -> None:
        """Record that a job held the interpreter; ``whole``: for the whole limit.

        A connection whose jobs do that again and again (from an ``at``, say) has all its jobs ended.  It is not to
        blame for what another one has put in the place of a library function, which is put back now
        (``Record.restore_held``).
        """
        lobby, now = lobby_of(job), time.monotonic()
        if lobby is None or lobby.world.record.is_replaced(_codes_of(frame)):
            return
        self._held = [each for each in self._held if now - each[1] < HOLD_WINDOW_S] + [(lobby, now, whole)]
        if sum(who is lobby and long for who, _, long in self._held) >= MAX_HOLDS:
            self._held = [each for each in self._held if each[0] is not lobby]
            log.warning("all jobs of %s are ended: they held the interpreter %d times", lobby.tag.tag.name, MAX_HOLDS)
            told = f"!!! all that this connection runs is ended: it held the interpreter {MAX_HOLDS} times"
            self._scheduler.post(lambda: end_all(lobby, told))

    def _write_error(self, job: Job, text: str) -> None:
        lobby = lobby_of(job)
        if lobby is not None:
            self._scheduler.post(lambda: lobby.output.line(text, "error"))


def _codes_of(frame: FrameType | None) -> set[CodeType]:
    """The codes of a frame and its callers."""
    codes = set()
    while frame is not None:
        codes.add(frame.f_code)
        frame = frame.f_back
    return codes


def end_signal(job: Job) -> JobSignal:
    """The signal that ends the running job; for the main job of a connection, that which ends its foreground statement.

    The caller reports the reason to the connection.
    """
    lobby = job.context
    return Interrupted(told=True) if isinstance(lobby, Lobby) and lobby.shell.is_running() else JobKilled()


class _Observation:
    """The state of one run: its count, the time of the first poll that saw it, and the interruptions requested since;
    those ``busy`` are processor times."""

    __slots__ = ("began", "began_busy", "broken", "broken_busy", "count", "interrupted", "limit", "named")

    def __init__(self, count: int, began: float) -> None:
        self.count = count
        self.began = began
        self.interrupted = 0.0
        self.began_busy = 0.0
        self.broken = 0.0
        self.broken_busy = 0.0
        self.limit = 0.0
        self.named = False
