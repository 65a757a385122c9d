"""What the scheduler refuses."""

from __future__ import annotations


class TooManyJobs(RuntimeError):
    """There are ``Scheduler.most_jobs`` jobs already: a program makes them without end."""
