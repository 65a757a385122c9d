"""What the scheduler refuses."""

from __future__ import annotations


class TooManyJobs(RuntimeError):
    """There are ``Scheduler.most_jobs`` jobs already, or ``most_jobs_of_one`` of one context: a program makes them
    without end."""

    def throw(self) -> None:
        """Raise it: what a job does that is refused."""
        raise self


class HeldTooLong(RuntimeError):
    """A job has not given way to the others for too long."""
