"""What the programs of one connection may take from the others."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Final

from urbihw.kernel.sched.scheduler import MOST_JOBS as MOST_JOBS  # for those who may not see the scheduler

MIB: Final = 1024 * 1024
HOLD_LIMIT: Final = 2.0
MEMORY_LIMIT: Final = 1024
MAX_JOBS: Final = 20_000


@dataclass(frozen=True)
class Bounds:
    """The bounds; the defaults are none at all, for a program that nobody else is connected to.

    Attributes:
        hold_limit: seconds that a job may hold the interpreter without giving way; 0: as long as it wants.
        memory_limit: bytes that the process may take while programs run; 0: any number.
        max_jobs: how many jobs one connection may have.
    """

    hold_limit: float = 0.0
    memory_limit: int = 0
    max_jobs: int = MOST_JOBS


NONE: Final = Bounds()


def bounds(hold_limit: float = HOLD_LIMIT, memory_limit: int = MEMORY_LIMIT, max_jobs: int = MAX_JOBS) -> Bounds:
    """The bounds of a server; ``memory_limit`` is in MiB, and never more than half of the memory of the machine."""
    return Bounds(hold_limit, min(memory_limit * MIB, machine_memory() // 2), max_jobs)


def machine_memory() -> int:
    """The memory of the machine, in bytes."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
