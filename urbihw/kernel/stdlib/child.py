"""Programs of the operating system as children of this process: started, waited for, and ended with their connection.

A child belongs to the connection whose job started it.  When that ends, the child and what it has started get SIGHUP,
as from a terminal that is closed: a program that ignores it (``nohup``) goes on, and so does one that a shell has left
in the background before the shell itself ended.
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

MOST: Final = 64
"""How many programs may run for one connection."""


class Child:
    """One program that runs, or is over.

    Attributes:
        inner: the program, with its pipes.
        code: its status as Python has it once it is over, None before: the exit code, or less than zero the signal.
    """

    inner: subprocess.Popen[bytes]

    def __init__(self, world: World, start: Callable[[int | None], subprocess.Popen[bytes]]) -> None:
        """Start it, which takes some milliseconds, while the running job waits.

        ``start(group)`` is called in another thread and starts it in this ``process_group``.  Raises OSError, or
        Exception.Primitive when this connection or the process has too many.
        """
        check_descriptors()
        # With a terminal, the programs share it, and its keys such as Ctrl-C are for them, too.
        self._leads = not os.isatty(0)
        self._given_up = False
        self.code: int | None = None
        self._holdings = holdings_of(world)
        self._scheduler = world.scheduler
        self._waiting = WaitQueue(world.scheduler)
        self.on_end: Callable[[], None] = lambda: None
        """Called outside any job when it is over."""
        self.on_close: Callable[[], None] = lambda: None
        """Called when its connection has ended before it."""
        self._holdings.own(self, "programs", MOST)
        try:
            pipes_of(world).starts.do(partial(self._start, start))
            self.descriptor = os.pidfd_open(self.inner.pid)
        except BaseException:
            self._holdings.disown(self)
            self._give_up()
            raise
        pipes_of(world).poller.attend(self)

    def _start(self, start: Callable[[int | None], subprocess.Popen[bytes]]) -> None:
        """In the other thread."""
        self.inner = start(0 if self._leads else None)
        if self._given_up:
            self._remove()

    def _give_up(self) -> None:
        """It is not wanted any more, whether it has started or is about to."""
        self._given_up = True
        if hasattr(self, "inner"):
            self._remove()

    def _remove(self) -> None:
        """Nobody has seen it run: end it, and leave nothing of it."""
        self.inner.kill()
        for pipe in (self.inner.stdin, self.inner.stdout, self.inner.stderr):
            if pipe is not None:
                pipe.close()
        self.inner.wait()

    def wait(self) -> int:
        """Wait for its end; its ``code``."""
        while self.code is None:
            self._waiting.wait()
        return self.code

    def kill(self) -> None:
        """End it by force, unless it is over."""
        if self.code is None:
            self.inner.kill()

    def close(self) -> None:
        """The connection has ended: tell the program so."""
        if not hasattr(self, "inner"):
            self._give_up()
        elif self.code is None:
            with suppress(ProcessLookupError, PermissionError):  # it may be over, or somebody else by now
                if self._leads:
                    os.killpg(self.inner.pid, signal.SIGHUP)
                else:
                    os.kill(self.inner.pid, signal.SIGHUP)
            self.on_close()

    def _ended(self) -> None:
        self.code = self.inner.wait()  # at once: it has ended
        self._holdings.disown(self)
        self._waiting.wake_all()
        self.on_end()

    # ---------------------------------------------------------------- for the thread

    def ready(self) -> int:
        """Tell of its end."""
        if os.waitid(os.P_PIDFD, self.descriptor, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
            return READ
        self._scheduler.post(self._ended)
        return OVER
