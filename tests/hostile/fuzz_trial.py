"""One random program on trial: in a kernel of its own, on a simulated clock, in a process of its own.

The process is a fork of one in which a kernel with an innocent lobby waits, so that it costs little and each program
finds the same.  Thus a program that hangs, crashes or eats the memory is found out, and spoils nothing.
"""

from __future__ import annotations

import faulthandler
import json
import logging
import os
import re
import resource
import select
import signal
import sys
import time
import traceback
from pathlib import Path
from types import FrameType

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.breaker import Breaker
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.signals import JobKilled
from urbihw.robot import ROBOT_LIBRARY

TIMEOUT_S = 20.0
"""Seconds of real time after which a program hangs."""
HOLD = 0.03
"""Seconds of the processor for which a job may hold the interpreter, at least; then it is killed."""
ROUNDS = 600
"""Rounds of the scheduler that a program gets."""
TURNS, TURNS_OF_OTHERS = 6, 100
"""In so many parts; and how many of them an innocent question, or an end, may take."""
SPAN = 5.0
"""Seconds of simulated time that it gets."""
JOBS = 2000
"""Jobs that it may have at a time, fewer than a server allows: that many are made sooner."""
MEMORY = 1 << 30
"""Bytes of memory that it gets; what is beyond is an error of its own."""
OURS = re.compile(r"internal error|Traceback|NoneType|object has no attribute|<class |<built-in|bug in urbihw"
                  r"|Exception ignored|0x[0-9a-f]{9,}>")
"""What must be neither in an answer nor in the log."""
STAYS = re.compile(r"disown|spawn|persist|create")
"""Words for jobs and lobbies that do not end with the connection that made them."""


class Records(logging.Handler):
    """Keeps what is logged."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """One record."""
        self.lines.append(record.getMessage() + (" Traceback" if record.exc_info else ""))


class Trial:
    """A kernel, and its innocent lobby; ``folder`` is where programs are played, ``patience`` as ``TIMEOUT_S``."""

    def __init__(self, folder: Path, kernel: Kernel | None = None, patience: float = TIMEOUT_S) -> None:
        self._folder = folder
        self._patience = patience
        self._kernel = kernel or Kernel(fast=True, libraries=(ROBOT_LIBRARY,))
        self._scheduler = self._kernel.scheduler
        self._scheduler.shares.max_of_one = JOBS
        self._rounds = 0
        self._most = 0
        self._scheduler.add_round_hook(self._round_over)
        self._held: tuple[object, int] = (None, 0)
        self._breaker = Breaker(self._scheduler, time.monotonic)
        self._innocent = self._kernel.open_lobby("127.0.0.1")
        self._heard(self._innocent, "1 + 1;\n")

    def problems(self, program: str) -> list[str]:
        """What is wrong with what the kernel does with a program; nothing if all is well."""
        ours, theirs = os.pipe()
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            os.close(ours)
            self._be_the_child(program, theirs)
        os.close(theirs)
        with os.fdopen(ours, "rb") as verdict:
            hangs = not select.select([verdict], [], [], self._patience)[0]
            if hangs:
                os.kill(child, signal.SIGKILL)
            text = verdict.read()
        _, status = os.waitpid(child, 0)
        if hangs:
            return ["hangs"]
        if not text:
            code = os.waitstatus_to_exitcode(status)
            return [f"the process ends: {signal.Signals(-code).name if code < 0 else code}"]
        found = json.loads(text)
        assert isinstance(found, list)
        return found

    # ---------------------------------------------------------------- in the child

    def _be_the_child(self, program: str, to: int) -> None:
        """Play the program, write the verdict, and never come back."""
        try:
            errors = os.memfd_create("errors")
            os.dup2(errors, 2)
            faulthandler.disable()
            size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
            os.chdir(self._folder)
            try:
                found = self._play(program)
            except BaseException:  # a signal for a job that comes out here would have ended the daemon
                found = [f"the kernel fails: {traceback.format_exc()[-2000:]}"]
            told = os.pread(errors, 1 << 16, 0).decode("latin-1")
            if OURS.search(told):
                found.append(f"on standard error: {told[-2000:]}")
            os.write(to, json.dumps(found).encode()[: 1 << 15])
        finally:
            os._exit(0)

    def _play(self, program: str) -> list[str]:
        records = Records()
        logging.getLogger("urbihw").addHandler(records)
        scheduler, found = self._scheduler, []
        jobs = set(scheduler.jobs)
        signal.signal(signal.SIGVTALRM, self._too_long)
        signal.setitimer(signal.ITIMER_VIRTUAL, HOLD, HOLD)
        attacker = self._kernel.open_lobby("127.0.0.1")
        said = self._heard(attacker, program + "\n", quiet=True)
        if not self._heard(self._innocent, "1 + 1;\n"):
            found.append("the other lobby is not answered")
        attacker.close()
        for _ in range(TURNS_OF_OTHERS):
            self._advance(ROUNDS // TURNS)
            if len(scheduler.jobs) <= len(jobs):
                break
        if not self._heard(self._innocent, "1 + 1;\n"):
            found.append("the other lobby is not answered when the connection is closed")
        left = [job.name for job in scheduler.jobs if job not in jobs]
        if left and not STAYS.search(program):
            found.append(f"jobs are left: {left[:5]} of {len(left)}")
        if OURS.search(said):
            found.append(f"answered: {said[-2000:]}")
        found += [f"logged: {line}" for line in records.lines if OURS.search(line)]
        return found

    def _heard(self, lobby: Lobby, text: str, quiet: bool = False) -> str:
        """The answer of a lobby to a text; nothing if there is no answer."""
        self._kernel.feed(lobby, text.encode("latin-1", "replace"))
        heard = ""
        for _ in range(TURNS if quiet else TURNS_OF_OTHERS):
            self._advance(ROUNDS // TURNS)
            heard += lobby.output.take_bytes().decode("latin-1")
            if heard and not quiet:
                break
        return heard

    def _advance(self, rounds: int) -> None:
        """Some rounds, or some time, whatever is over first."""
        scheduler, clock = self._scheduler, self._kernel.clock
        assert isinstance(clock, SimClock)
        until = clock.now() + SPAN / TURNS
        self._most = self._rounds + rounds
        while self._rounds < self._most:
            deadline = scheduler.run()
            if deadline is None or deadline > until:
                clock.idle(until)
                return
            clock.idle(deadline)

    def _round_over(self) -> None:
        self._rounds += 1
        if self._rounds >= self._most:
            self._scheduler.interrupt()

    def _too_long(self, number: int, frame: FrameType | None) -> None:
        """Time has passed: a job that has held the interpreter since the last time is killed.

        The program gets no more rounds before somebody else is asked, since a job that runs alone makes none.
        """
        scheduler = self._scheduler
        held = scheduler.current, scheduler.cycle
        if held == self._held:
            self._breaker.break_in(frame, JobKilled())
        self._held = held
        self._most = self._rounds
        scheduler.interrupt()
