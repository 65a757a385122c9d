"""Limits on the interpreter time, memory and jobs that the programs of one connection may use."""

from __future__ import annotations

import os
from typing import Final

from urbihw.frozen import frozen
from urbihw.kernel.sched.shares import MAX_TOTAL_JOBS as MAX_TOTAL_JOBS  # for those who may not see the scheduler

MIB: Final = 1024 * 1024
HOLD_LIMIT: Final = 0.5
MEMORY_LIMIT: Final = 1024
MAX_JOBS: Final = 20_000


@frozen(slots=False)
class Bounds:
    """The limits.  The defaults set none: they are for a program that serves no other connection.

    Attributes:
        hold_limit: seconds of processor time that a job may hold the interpreter without yielding; 0: no limit.
        memory_limit: bytes of memory that the process may have while programs run; 0: no limit.
        max_jobs: maximum number of jobs of one connection.
    """

    hold_limit: float = 0.0
    memory_limit: int = 0
    max_jobs: int = MAX_TOTAL_JOBS


NONE: Final = Bounds()


def bounds(hold_limit: float = HOLD_LIMIT, memory_limit: int = MEMORY_LIMIT, max_jobs: int = MAX_JOBS) -> Bounds:
    """The limits of a server.  ``memory_limit`` is in MiB and is reduced to half of the memory of the machine."""
    return Bounds(hold_limit, min(memory_limit * MIB, machine_memory() // 2), max_jobs)


def machine_memory() -> int:
    """The size of the memory of the machine, in bytes."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
