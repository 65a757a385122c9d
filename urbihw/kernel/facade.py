"""The kernel as the daemon, the commands and the tests see it."""

from __future__ import annotations

import sys
import weakref
from collections.abc import Callable

from urbihw.kernel.boot import build
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.clock import Clock, RealClock, SimClock
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.uobject import Host

DEPTH = 5000
"""How deep calls may nest, in Python frames: a good four thousand urbiscript calls.  Operators of objects and callbacks
of the library also take C stack; with 6000 the worst of them still fit into the usual 8 MB."""


class Kernel:
    """One urbiscript world with its scheduler.

    ``clock`` decides about time: a ``RealClock`` under the daemon, a ``SimClock`` in tests and with ``fast``.  Drive
    it by ``run()``, which returns when to call again; hand in bytes with ``feed``; take a lobby's output from
    ``lobby.output.take()``.  ``host`` is what device code gets.  ``post`` is the one call allowed from other threads.
    """

    def __init__(
        self, clock: Clock | None = None, wake_host: Callable[[], None] = lambda: None, *, fast: bool = False
    ) -> None:
        sys.setrecursionlimit(max(DEPTH, sys.getrecursionlimit()))
        self.clock = clock if clock is not None else SimClock() if fast else RealClock()
        self.scheduler = Scheduler(self.clock, wake_host)
        self.programs = build(self.scheduler)
        self.world = self.programs.world
        self.host = Host(self.world, self.programs)
        self._end = weakref.finalize(self, self.scheduler.abandon)
        self._end.atexit = False

    def complete(self) -> None:
        """Start-up is complete: what the library and the robot are now is what they are brought back to when a program
        spoils them.  Without this call they are what they were when the first lobby was opened."""
        self.world.record.take()

    def open_lobby(
        self, remote: str | None = None, wanted: Callable[[Lobby], None] = lambda lobby: None, limit: int = 8 << 20
    ) -> Lobby:
        """A lobby for a new connection; ``wanted(lobby)`` is called when it has something to say.

        It is greeted with the banner unless ``programs.quiet``, and finds the library whole: what programs spoilt is
        put back, and the client is told.
        """
        told = self.world.record.check()
        lobby = Lobby(self.world, self.programs, wanted, remote, limit)
        if not self.programs.quiet:
            lobby.greet()
        for line in told:
            lobby.output.line(f"*** urbihw: {line}")
        return lobby

    def feed(self, lobby: Lobby, data: bytes) -> None:
        """Bytes from a client, cut anywhere."""
        lobby.feed(data)

    def run(self) -> float | None:
        """Run what is ready; the time (of ``clock``) to call again, None for when something happens."""
        return self.scheduler.run()

    def post(self, action: Callable[[], None]) -> None:
        """From any thread: run ``action`` between two rounds."""
        self.scheduler.post(action)

    def close(self) -> None:
        """End all jobs wherever they are, so that memory can be taken back; twice is fine, and nothing runs any more.

        A kernel that nobody holds is closed by itself, but one whose jobs hold it (by a device's callback, say) is not.
        """
        self._end()

    def run_text(self, lobby: Lobby, text: str, until: float | None = None) -> str:
        """Feed a program and run it in simulated time until nothing is left to do; what the lobby said."""
        assert isinstance(self.clock, SimClock), "run_text needs a simulated clock"
        lobby.feed(text.encode("latin-1", "replace"))
        self.scheduler.run_simulated(until)
        return lobby.output.take().decode("latin-1")
