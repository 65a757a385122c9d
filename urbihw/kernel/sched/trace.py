"""Hooks for an observer of the scheduler; without a tracer they cost nothing.

Usage: ``scheduler.tracer = MyTracer()``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job


class Tracer:
    """Base class of tracers: override the hooks that you need."""

    def created(self, job: Job) -> None:
        """A job was made; it has not run yet."""

    def ended(self, job: Job) -> None:
        """A job is over, with or without an error."""
