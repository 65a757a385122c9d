"""How much processor time each context has used lately: who used little is served first when there is not enough.

This is fair queueing by virtual time, as in the Linux scheduler.  Each context has an account, in seconds: the level at
which it came plus what its turns took.  The level rises with the account of the context that is served, and with time
that is not charged.  An account that has fallen behind the level by more than ``CREDIT_S`` counts as ``CREDIT_S``
behind: a context that has slept goes first, but cannot make the others wait for all the time that it did not use.

Only contexts that have waited for each other are charged (``Scheduler.run``), so a server that is not busy reads no
clock for this.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

CREDIT_S: Final = 0.05
"""Seconds of processor time that a context may be ahead of others at most, because it used little before."""


class _Account:
    """What one context has used, in seconds of virtual time, and the number of its last turn that was charged."""

    __slots__ = ("served", "used")

    def __init__(self, used: float) -> None:
        self.used = used
        self.served = 0


class Accounts:
    """The accounts of all contexts that have jobs."""

    def __init__(self, processor_time: Callable[[], float]) -> None:
        """``processor_time`` returns the processor time of the thread that runs the jobs, in seconds."""
        self._processor_time = processor_time
        self._last = processor_time()
        self._level = 0.0
        self._served = 0
        self._accounts: dict[Any, _Account] = {}

    def open(self, context: Any) -> None:
        """A context has its first job."""
        self.skip()
        self._accounts[context] = _Account(self._level)

    def close(self, context: Any) -> None:
        """A context has no jobs any more."""
        del self._accounts[context]

    def skip(self) -> None:
        """Let the level rise by the processor time since the last call: no context is charged with it."""
        self._level += self._passed()

    def charge(self, context: Any, most: float) -> float:
        """A turn of a context is over: charge it with the processor time since the last call; return that time.

        The context is charged with ``most`` seconds at most, and not at all if it has no jobs any more.
        """
        passed = self._passed()
        account = self._accounts.get(context)
        if account is None:
            self._level += passed
            return 0.0
        used = min(passed, most)
        before = max(account.used, self._level - CREDIT_S)
        account.used = before + used
        self._served += 1
        account.served = self._served
        self._level = max(self._level, before) + passed - used
        return used

    def rank(self, context: Any) -> tuple[float, int]:
        """The account of a context, and the number of its last turn: the lowest rank is served first."""
        account = self._accounts.get(context)
        if account is None:  # its jobs are over, and their turns take no time
            return self._level - CREDIT_S, 0
        return max(account.used, self._level - CREDIT_S), account.served

    def _passed(self) -> float:
        now = self._processor_time()
        passed, self._last = max(0.0, now - self._last), now
        return passed
