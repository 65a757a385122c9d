"""A robot of Webots in a process of its own: ``python -m urbihw.platforms.webots.controller_process FD URL``.

Its library keeps its state for the whole process, and a step lasts as long as somebody pauses the simulation: the
worker must be able to stop, and to connect again, meanwhile.  FD is one end of a pipe: steps and orders go in, and an
outcome comes back for each; first comes the world, or one line that tells why there is none.
"""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
import sys
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from urbihw.buses.errors import LinkGone, Unavailable
from urbihw.platforms.webots.simulator import BackEnd, Outcome, SimulatedWorld, StepOrder

CONNECT_TIMEOUT_S: Final = 8.0
"""Seconds to wait for Webots before the worker tries again; its library retries for itself for longer.  The worker may
be silent for as long as that while it opens its link."""
END_TIMEOUT_S: Final = 0.5
"""Seconds to leave the simulation."""


class ControllerProcess:
    """The parent's end; see ``port.Simulation``."""

    world: SimulatedWorld

    def __init__(self, url: str) -> None:
        """Start the process and wait for the world.  Raises Unavailable."""
        mine, theirs = Pipe()
        root = str(Path(__file__).resolve().parents[3])
        path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
        with theirs:
            self._process = subprocess.Popen(
                (sys.executable, "-m", "urbihw.platforms.webots.controller_process", str(theirs.fileno()), url),
                pass_fds=(theirs.fileno(),), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": path, "PYTHONIOENCODING": "UTF-8"},
            )  # fmt: skip
        self._pipe = mine
        problem = f"no Webots answers at {url or 'this machine'}: does it run, and is the controller <extern>?"
        try:
            if mine.poll(CONNECT_TIMEOUT_S):
                first = mine.recv()
                if isinstance(first, SimulatedWorld):
                    self.world = first
                    return
                problem = str(first)
        except (EOFError, OSError):
            pass
        self.close()
        raise Unavailable(errno.EHOSTUNREACH, problem)

    def begin(self, ms: int, orders: list[StepOrder]) -> None:
        with contextlib.suppress(OSError):  # ``poll`` tells it.
            self._pipe.send((ms, orders))

    def poll(self) -> Outcome | None:
        try:
            if not self._pipe.poll():
                return None
            outcome: Outcome = self._pipe.recv()
        except (EOFError, OSError) as error:
            raise LinkGone("Webots has ended, or its controller library has") from error
        return outcome

    def close(self) -> None:
        """End the process; it leaves the simulation, which would wait for it."""
        self._pipe.close()
        try:
            self._process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def serve(back_end: BackEnd, pipe: Connection) -> None:
    """Answer steps until the other end is closed."""
    pipe.send(back_end.world)
    with contextlib.suppress(EOFError, OSError):
        while True:
            ms, orders = pipe.recv()
            outcome = back_end.run(ms, orders)
            pipe.send(outcome)
            if outcome.ended:
                return


def main(arguments: list[str]) -> int:
    """Run the process; returns the exit status."""
    from urbihw.platforms.webots.controller import NoWebots, WebotsRobot, import_controller

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    pipe = Connection(int(arguments[0]))
    try:
        back_end = WebotsRobot(import_controller(arguments[1]))
    except NoWebots as error:
        pipe.send(str(error))
        return 1
    serve(back_end, pipe)
    back_end.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
