"""The kernel as the daemon, the commands and the tests see it."""

from __future__ import annotations

import sys
import weakref
from collections.abc import Callable, Sequence

from urbihw.kernel.boot import KernelHooks, build
from urbihw.kernel.lobby.host_process import HostProcess
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.clock import Clock, LedClock, RealClock, SimClock
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.stdlib import Library

__all__ = ["HostProcess", "Kernel", "Library"]

RECURSION_LIMIT = 5000
"""Maximum depth of nested calls, in Python frames: about four thousand urbiscript calls.  Operators of objects and
callbacks of the library use C stack as well; with 6000 frames, the worst of them still fit into the usual 8 MB."""

NO_PROCESS = HostProcess()
"""Programs cannot end the process, nor restart it."""


class Kernel:
    """One urbiscript world with its scheduler.

    ``clock`` provides the time: a ``RealClock`` in the daemon, a ``LedClock`` with ``led`` for a robot that is a
    simulation, a ``SimClock`` in tests and with ``fast``.  Run it by
    ``run()``, which returns when to call it again; pass input with ``feed``; read a lobby's output with
    ``lobby.output.take_bytes()``.  Device code gets ``host``.  ``process`` is what programs can do with the process,
    such as to end it.  ``libraries`` are loaded after the standard library, such as that of robots (``urbihw.robot``).
    ``post`` is the only method that other threads may call.
    """

    def __init__(
        self,
        clock: Clock | None = None,
        wake_host: Callable[[], None] = lambda: None,
        *,
        fast: bool = False,
        led: bool = False,
        process: HostProcess = NO_PROCESS,
        libraries: Sequence[Library] = (),
    ) -> None:
        sys.setrecursionlimit(max(RECURSION_LIMIT, sys.getrecursionlimit()))
        self.clock = clock if clock is not None else SimClock() if fast else LedClock() if led else RealClock()
        self.scheduler = Scheduler(self.clock, wake_host, KernelHooks())
        self.programs, self.host = build(self.scheduler, process, libraries)
        self.world = self.programs.world
        self._end = weakref.finalize(self, self.scheduler.abandon)
        self._end.atexit = False

    def complete(self) -> None:
        """Mark the end of the start-up: the present state of the library and the robot is the one to which it is
        restored after a program has changed it.  Without this call it is the state when the first lobby was opened."""
        self.world.record.take_snapshot()

    def open_lobby(
        self, remote: str | None = None, wanted: Callable[[Lobby], None] = lambda lobby: None, limit: int = 8 << 20
    ) -> Lobby:
        """Open a lobby for a new connection; ``wanted(lobby)`` is called when it has output.

        It receives the banner unless ``programs.quiet``.  Library slots that programs have changed are restored, and
        the client gets a message.
        """
        told = self.world.record.check()
        lobby = Lobby(self.world, self.programs, wanted, remote, limit)
        if not self.programs.quiet:
            lobby.greet()
        for line in told:
            lobby.output.line(f"*** urbihw: {line}")
        return lobby

    def feed(self, lobby: Lobby, data: bytes) -> None:
        """Add input from a client, in pieces of any size."""
        lobby.feed(data)

    def run(self) -> float | None:
        """Run the ready jobs; returns the time (of ``clock``) of the next call, None to wait for an event."""
        return self.scheduler.run()

    def post(self, action: Callable[[], None]) -> None:
        """From any thread: run ``action`` between two rounds."""
        self.scheduler.post(action)

    def close(self) -> None:
        """End all jobs, so that their memory can be freed; a second call has no effect.

        A kernel without references is closed automatically, unless its own jobs refer to it (by a device's callback,
        for example).
        """
        self._end()

    def run_text(self, lobby: Lobby, text: str, until: float | None = None) -> str:
        """Run a program in simulated time until no job is left; returns the output of the lobby."""
        assert isinstance(self.clock, SimClock), "run_text needs a simulated clock"
        lobby.feed(text.encode("latin-1", "replace"))
        self.scheduler.run_simulated(until)
        return lobby.output.take_bytes().decode("latin-1")
