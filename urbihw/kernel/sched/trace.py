"""Hooks by which an observer follows the scheduler; the default does nothing and costs nothing.

A tracer is built on these, never on prints: `scheduler.tracer = MyTracer()`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job


class Tracer:
    """Override what you want to see."""

    def created(self, job: Job) -> None:
        """A job was made; it has not run yet."""

    def ended(self, job: Job) -> None:
        """A job is over, well or not."""
