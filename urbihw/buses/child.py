"""A worker as a process of its own: `python -m urbihw.buses.child FD FAMILY URL`, started by `Worker.start`.

FD is the worker's end of the pipe; the first message through it is `Begin`. Ctrl-C is for the parent to decide;
SIGTERM stops the robot and ends, and so does the end of the parent, which shows as the end of the pipe or, should
somebody have inherited that, as another parent id.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType

from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.buses.link import Context
from urbihw.buses.mailbox import Mailbox
from urbihw.buses.messages import Begin


def main(arguments: list[str]) -> int:
    """Run a worker; returns the exit status 0."""
    pipe_fd, family, url = arguments
    parent = os.getppid()
    terminated = False

    def terminate(_signal: int, _frame: FrameType | None) -> None:
        nonlocal terminated
        terminated = True

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, terminate)
    pipe = Connection(int(pipe_fd))
    try:
        begin = pipe.recv()
    except (EOFError, OSError):
        return 0
    if not isinstance(begin, Begin):
        raise TypeError(f"our bug: the first message to a worker must be Begin, not {begin!r}")
    _sharpen_timer()
    mailbox = Mailbox(pipe)
    Engine(url, driver_of(family), mailbox, begin, Context(), lambda: terminated or os.getppid() != parent).run()
    return 0


def _sharpen_timer() -> None:
    """Ask the kernel not to stretch our sleeps by its usual 50 us; where it cannot be asked, nothing is lost."""
    with contextlib.suppress(OSError):
        Path("/proc/self/timerslack_ns").write_text("1", encoding="ascii")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
