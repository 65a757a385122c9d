"""The processor of a bus worker: real-time scheduling, where the system allows it, and how long it waited for its turn.

A worker has little to do, and has to do it in time: a panel, a camera or a compiler beside it must not delay the wire.
Under real-time scheduling (SCHED_RR) it runs as soon as it has something to do, and its memory stays in place. A worker
that computes without a pause would then take its processor from everything else: the kernel sends it SIGXCPU after
`LONGEST_RUN_S`, whereupon it goes on as any program does, and ends it after `KILLED_AFTER_S`.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
from pathlib import Path
from types import FrameType
from typing import Final

PRIORITY: Final = 5
"""Real-time priority, 1..99; the unit of systemd allows this one (LimitRTPRIO). Those of the kernel are higher."""
NICENESS: Final = -10
"""Where real time is not allowed; that takes a right, too."""
LONGEST_RUN_S: Final = 0.5
KILLED_AFTER_S: Final = 2.0
"""Seconds of processor time without a wait: of the signal, and of the end."""
ORDINARY: Final = "as any program"
REAL_TIME: Final = "in real time"
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_NS: Final = 1e-9


def held_up(process: int | str = "self") -> float | None:
    """Return the seconds so far in which the main thread of a process had something to do and no processor; None if
    unknown."""
    return _scheduled(process, 1)


def work_of(process: int | str) -> float | None:
    """Return the seconds so far in which the main thread of a process had a processor; None if unknown."""
    return _scheduled(process, 0)


def crowd() -> float:
    """Return how many programs want each processor of this machine, over the last minute; above 1 they wait."""
    return os.getloadavg()[0] / (os.cpu_count() or 1)


def _scheduled(process: int | str, column: int) -> float | None:
    try:
        return int(Path(f"/proc/{process}/schedstat").read_text("ascii").split()[column]) * _NS
    except (OSError, ValueError, IndexError):
        return None


def is_stopped(process: int) -> bool:
    """Return whether a process is stopped by a signal (SIGSTOP, Ctrl-Z): it does nothing until somebody continues
    it."""
    try:
        return Path(f"/proc/{process}/stat").read_bytes().rpartition(b") ")[2][:1] == b"T"
    except OSError:
        return False


class Processor:
    """The processor of a worker that shares its process, as in tests.

    Attributes:
        scheduling: how the worker is scheduled, in words.
    """

    def __init__(self) -> None:
        self.scheduling = ORDINARY

    def held_up(self) -> float | None:
        """Return the seconds so far in which the worker had something to do and no processor; None if unknown."""
        return None

    def crowd(self) -> float:
        """Return how many programs want each processor of this machine; 0 if unknown."""
        return 0.0


class OwnProcessor(Processor):
    """The processor of a worker that has a process of its own; to be made in its main thread."""

    def held_up(self) -> float | None:
        return held_up()

    def crowd(self) -> float:
        return crowd()

    def claim(self) -> None:
        """Take real-time scheduling, else a niceness, as far as the system allows it; never raises."""
        try:
            _bound_runs()
            signal.signal(signal.SIGXCPU, self._give_back)
            os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
        except (OSError, ValueError):
            self._be_less_nice()
            return
        self.scheduling = REAL_TIME + (", memory locked" if _lock_memory() else "")

    def _be_less_nice(self) -> None:
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
            self.scheduling = f"with niceness {NICENESS}"

    def _give_back(self, _signal: int, _frame: FrameType | None) -> None:
        # Without a right to it, the flag cannot be taken back.  An error would end the worker from within the handler.
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))
        self.scheduling = f"{ORDINARY}: in real time it computed for {LONGEST_RUN_S:g} s without a pause"


def may_claim() -> bool:
    """Return whether this user's processes may have real-time scheduling."""
    return os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_RTPRIO)[0] >= PRIORITY


def _bound_runs() -> None:
    """Bound the time for which this process may compute in real time without a wait. Raises OSError, ValueError."""
    wanted = tuple(round(seconds * 1_000_000) for seconds in (LONGEST_RUN_S, KILLED_AFTER_S))
    present = resource.getrlimit(resource.RLIMIT_RTTIME)
    lower = [now if 0 <= now < new else new for now, new in zip(present, wanted, strict=True)]
    resource.setrlimit(resource.RLIMIT_RTTIME, (min(lower), lower[1]))


def _lock_memory() -> bool:
    """Keep the pages of this process in memory, those that it will use, too; return whether that is allowed."""
    with contextlib.suppress(OSError, AttributeError, MemoryError):
        return bool(ctypes.CDLL(None).mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) == 0)
    return False
