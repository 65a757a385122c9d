"""The shares of the contexts: how many jobs each of them has and may have, and the account of its processor time."""

from __future__ import annotations

from typing import Any, Final

from urbihw.kernel.sched.accounts import Accounts
from urbihw.kernel.sched.errors import TooManyJobs

MAX_TOTAL_JOBS: Final = 150_000
"""Maximum number of jobs.  A started job takes about 8 kB, and a program that forks without end reaches the limit
within seconds."""
RESERVED_JOBS: Final = 100
"""Number of jobs that each context may have even when ``max_total`` is reached."""


class Shares:
    """The numbers of jobs of all contexts that have some.

    Attributes:
        max_total: maximum number of jobs of all contexts together.
        max_of_one: maximum number of jobs of one context.
    """

    def __init__(self, accounts: Accounts) -> None:
        self._accounts = accounts
        self.max_total = self.max_of_one = MAX_TOTAL_JOBS
        self._numbers: dict[Any, int] = {}

    def of(self, context: Any) -> int:
        """The number of jobs of a context."""
        return self._numbers.get(context, 0)

    def refusal(self, context: Any, total: int) -> TooManyJobs | None:
        """Why a context may not have one more job, while there are ``total``; None if it may."""
        number = self._numbers.get(context, 0)
        if number >= self.max_of_one:
            return TooManyJobs(f"too many jobs: {number} of this connection")
        if number >= RESERVED_JOBS and total >= self.max_total:
            return TooManyJobs("too many jobs")
        return None

    def add(self, context: Any) -> None:
        """A job of a context was made."""
        number = self._numbers.get(context, 0)
        if not number:
            self._accounts.open(context)
        self._numbers[context] = number + 1

    def remove(self, context: Any) -> None:
        """A job of a context is over."""
        number = self._numbers[context] - 1
        if number:
            self._numbers[context] = number
        else:
            del self._numbers[context]
            self._accounts.close(context)
