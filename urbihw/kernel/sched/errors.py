"""Errors of the scheduler."""

from __future__ import annotations


class TooManyJobs(RuntimeError):
    """A new job was refused: there are ``Scheduler.max_total_jobs`` jobs, or ``max_jobs_per_context`` jobs of its
    context.
    """

    def throw(self) -> None:
        """Raise this error: the body of a job that was refused."""
        raise self


class HeldTooLong(RuntimeError):
    """A job has held the interpreter for too long without yielding."""
