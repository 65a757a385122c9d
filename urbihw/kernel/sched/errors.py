"""Errors of the scheduler."""

from __future__ import annotations


class TooManyJobs(RuntimeError):
    """A new job was refused: there are ``Shares.max_total`` jobs, or ``Shares.max_of_one`` jobs of its context.
    """

    def throw(self) -> None:
        """Raise this error: the body of a job that was refused."""
        raise self


class HeldTooLong(RuntimeError):
    """A job has held the interpreter for too long without yielding."""
