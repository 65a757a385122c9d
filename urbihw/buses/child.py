"""A worker as a process of its own: `python -m urbihw.buses.child FD FAMILY URL`, started by `Worker.start`.

FD is the worker's end of the pipe; the first message through it is `Begin`. Until then the process has touched nothing,
and has imported what it needs: a spare worker waits there for hours. SIGINT is ignored: the parent handles Ctrl-C.
SIGTERM stops the robot and ends the worker. So does the death of the parent, which is seen as the end of the pipe or,
if another process has inherited the pipe, as a changed parent process id.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType

from urbihw import buses
from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.buses.errors import BadUrl, Unavailable
from urbihw.buses.link import Context
from urbihw.buses.mailbox import Mailbox
from urbihw.buses.messages import Begin
from urbihw.buses.processor import OwnProcessor, work_of


def main(arguments: list[str]) -> int:
    """Run a worker; returns the exit status 0."""
    pipe_fd, family, url = arguments
    parent = os.getppid()
    terminated = False

    def terminate(_signal: int, _frame: FrameType | None) -> None:
        nonlocal terminated
        terminated = True

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    pipe = Connection(_lower_descriptor(int(pipe_fd)))
    driver = driver_of(family)
    with contextlib.suppress(BadUrl, Unavailable):
        # Only for the import; what is wrong with it is reported when the link is opened.
        buses.port_class(url)
    try:
        begin = pipe.recv()
    except (EOFError, OSError):
        return 0
    signal.signal(signal.SIGTERM, terminate)
    if not isinstance(begin, Begin):
        raise TypeError(f"our bug: the first message to a worker must be Begin, not {begin!r}")
    _sharpen_timer()
    processor = OwnProcessor()
    if begin.settings.realtime:
        processor.claim()
    mailbox = Mailbox(pipe)
    context = Context(parent_work=lambda: work_of(parent))
    Engine(url, driver, mailbox, begin, context, lambda: terminated or os.getppid() != parent, processor).run()
    return 0


def _lower_descriptor(fd: int) -> int:
    """Move a descriptor to the lowest free number: it has that of a daemon with many clients, and ``select``, whose
    time-out is finer than that of ``poll``, takes numbers below 1024 only."""
    low = os.dup(fd)
    os.close(fd)
    return low


def _sharpen_timer() -> None:
    """Set the timer slack of this process to 1 ns (the Linux default is 50 us); ignored where there is no such file."""
    with contextlib.suppress(OSError):
        Path("/proc/self/timerslack_ns").write_text("1", encoding="ascii")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
