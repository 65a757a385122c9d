"""Child processes: programs of the operating system that jobs start and wait for, and that end with their connection.

A child belongs to the connection whose job started it.  When the connection ends, the child and its own children get
SIGHUP, as if their terminal was closed: a program that ignores the signal (``nohup``) continues, and so does a program
that a shell has left in the background before the shell itself ended.
"""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Final

from urbihw.kernel.runtime.holdings import holdings_of
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.waiting import WaitQueue
from urbihw.kernel.stdlib.pipe import pipes_of
from urbihw.kernel.stdlib.poller import OVER, READ
from urbihw.kernel.stdlib.support import check_descriptors

MAX_CHILDREN: Final = 64
"""Maximum number of running programs per connection."""


class Child:
    """One child process, running or ended.

    Attributes:
        inner: the process, with its pipes.
        code: its status after its end, as Python reports it: the exit code, or the negated signal number.  None before.
    """

    inner: subprocess.Popen[bytes]

    def __init__(self, world: World, start: Callable[[int | None], subprocess.Popen[bytes]]) -> None:
        """Start the program, which takes some milliseconds, while the running job waits.

        ``start(group)`` is called in another thread and starts it in this ``process_group``.  Raises OSError, or
        Exception.Primitive if this connection or the process has too many children.
        """
        check_descriptors()
        # In a terminal, the programs share the process group so that they get its keys such as Ctrl-C.
        self._leads = not os.isatty(0)
        self._given_up = False
        self.code: int | None = None
        self._holdings = holdings_of(world)
        self._scheduler = world.scheduler
        self._waiting = WaitQueue(world.scheduler)
        self.on_end: Callable[[], None] = lambda: None
        """Called outside any job when the program has ended."""
        self.on_close: Callable[[], None] = lambda: None
        """Called if the connection ends before the program."""
        self._holdings.register(self, "programs", MAX_CHILDREN)
        try:
            pipes_of(world).starter.run_work(partial(self._start, start))
            self.descriptor = os.pidfd_open(self.inner.pid)
        except BaseException:
            self._holdings.unregister(self)
            self._give_up()
            raise
        pipes_of(world).poller.schedule(self)

    def _start(self, start: Callable[[int | None], subprocess.Popen[bytes]]) -> None:
        """Start the program, in the other thread."""
        self.inner = start(0 if self._leads else None)
        if self._given_up:
            self._remove()

    def _give_up(self) -> None:
        """End the program, or the attempt to start it: the job does not wait for it any more."""
        self._given_up = True
        if hasattr(self, "inner"):
            self._remove()

    def _remove(self) -> None:
        """End a program whose start no job has observed, and release its resources."""
        self.inner.kill()
        for pipe in (self.inner.stdin, self.inner.stdout, self.inner.stderr):
            if pipe is not None:
                pipe.close()
        self.inner.wait()

    def wait(self) -> int:
        """Wait for the end of the program; returns its ``code``."""
        while self.code is None:
            self._waiting.wait()
        return self.code

    def kill(self) -> None:
        """Kill the program with SIGKILL unless it has ended."""
        if self.code is None:
            self.inner.kill()

    def close(self) -> None:
        """Send SIGHUP to the program because its connection has ended."""
        if not hasattr(self, "inner"):
            self._give_up()
        elif self.code is None:
            with suppress(ProcessLookupError, PermissionError):  # the group may have ended
                if self._leads:
                    os.killpg(self.inner.pid, signal.SIGHUP)
                else:
                    os.kill(self.inner.pid, signal.SIGHUP)
            self.on_close()

    def _ended(self) -> None:
        self.code = self.inner.wait()  # no delay: the program has ended
        self._holdings.unregister(self)
        self._waiting.wake_all()
        self.on_end()

    # ---------------------------------------------------------------- for the thread

    def ready(self) -> int:
        """Called when the program has ended."""
        if os.waitid(os.P_PIDFD, self.descriptor, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
            return READ
        self._scheduler.post(self._ended)
        return OVER
