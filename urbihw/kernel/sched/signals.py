"""Signals: exceptions that are thrown into a job to make it leave its code.

All are ``BaseException``s, so that an ``except Exception`` of a device does not catch them.  They are not errors and
are never shown.
"""

from __future__ import annotations

from typing import Any, Final

from urbihw.kernel.sched.coro import CarrierEnded


class JobSignal(BaseException):
    """Base of everything that unwinds a job without being an error."""


class JobKilled(JobSignal):
    """Ends the job: its connection was closed, or a program called ``terminate``."""


class JobAborted(JobKilled):
    """Ends the job at once: the time for its ``finally`` clauses is over, and no further one is started."""


class Interrupted(JobSignal):
    """The user has interrupted the statement in the foreground of the lobby.

    ``told``: the user gets another message about it.
    """

    def __init__(self, told: bool = False) -> None:
        super().__init__()
        self.told = told


class StopTag(JobSignal):
    """Leaves the code under one tag entry, with a value."""

    def __init__(self, entry: Any, value: Any) -> None:
        super().__init__()
        self.entry = entry
        self.value = value


class Leave(JobSignal):
    """A return, break or continue that goes from one job to the job that waits for it.

    ``token`` identifies the function call or the loop that it leaves or continues.
    """

    def __init__(self, token: Any, value: Any = None) -> None:
        super().__init__()
        self.token = token
        self.value = value


UNWINDING: Final = (JobKilled, Interrupted, StopTag, CarrierEnded)
"""The signals that end a job or leave a tag.  Errors in ``finally`` clauses on the way do not replace them."""


def supersedes(new: BaseException, old: BaseException) -> bool:
    """Whether ``new``, raised while ``old`` unwinds a job, replaces it.

    An error or a jump replaces another one, as in Python, but does not replace a signal that ends a job or leaves a
    tag.
    """
    if not isinstance(old, UNWINDING):
        return True
    if isinstance(new, UNWINDING):
        return takes_precedence(new, old)
    return not isinstance(new, Exception | Leave)


def takes_precedence(new: BaseException, old: BaseException) -> bool:
    """Whether, of two exceptions for one job, ``new`` leads further out than ``old`` and replaces it."""
    if isinstance(old, JobAborted | CarrierEnded):
        return False
    if isinstance(old, JobKilled | Interrupted):
        return isinstance(new, JobKilled)
    if isinstance(new, StopTag) and isinstance(old, StopTag):
        return bool(new.entry.depth < old.entry.depth)
    return True
