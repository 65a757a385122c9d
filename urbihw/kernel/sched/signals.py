"""What is thrown into a job to make it leave what it does.

All are ``BaseException``s: a device's ``except Exception`` cannot eat them.  They are not errors and are never shown.
"""

from __future__ import annotations

from typing import Any, Final

from urbihw.kernel.sched.coro import CarrierEnded


class Signal(BaseException):
    """Base of everything that unwinds a job without being an error."""


class JobKilled(Signal):
    """The job is to end: its connection closed, or somebody called ``terminate``."""


class JobAborted(JobKilled):
    """The job is to end at once: its ``finally`` clauses have had their time, and no further one is begun."""


class Interrupted(Signal):
    """The user wants the prompt back: the foreground job of his lobby is to be left.

    ``told`` says that he is told of it in other words.
    """

    def __init__(self, told: bool = False) -> None:
        super().__init__()
        self.told = told


class StopTag(Signal):
    """The code under one tag entry is to be left, with a value."""

    def __init__(self, entry: Any, value: Any) -> None:
        super().__init__()
        self.entry = entry
        self.value = value


class Leave(Signal):
    """return, break or continue that has to cross from one job into the one that waits for it.

    ``token`` names the function call or the loop to be left or gone on with.
    """

    def __init__(self, token: Any, value: Any = None) -> None:
        super().__init__()
        self.token = token
        self.value = value


UNWINDING: Final = (JobKilled, Interrupted, StopTag, CarrierEnded)
"""What is on its way to the end of a job, or out of a tag, and must get there whatever is done on the way."""


def supersedes(new: BaseException, old: BaseException) -> bool:
    """Whether ``new``, raised by what is done while ``old`` unwinds a job, is to go on in its place.

    An error or a jump supersedes another one, as in Python, but not what ends a job or leaves a tag.
    """
    if not isinstance(old, UNWINDING):
        return True
    if isinstance(new, UNWINDING):
        return goes_further(new, old)
    return not isinstance(new, Exception | Leave)


def goes_further(new: BaseException, old: BaseException) -> bool:
    """Whether, of two that are to reach one job, the new one leads further out."""
    if isinstance(old, JobAborted | CarrierEnded):
        return False
    if isinstance(old, JobKilled | Interrupted):
        return isinstance(new, JobKilled)
    if isinstance(new, StopTag) and isinstance(old, StopTag):
        return bool(new.entry.depth < old.entry.depth)
    return True
