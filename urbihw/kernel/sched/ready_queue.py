"""The ready queue: in which order the ready jobs get their turns.

Usually all ready jobs stand in one queue, first in first out, whatever context they belong to.  When a round of all of
them takes too long, ``Scheduler.run`` has to interrupt it.  From then on rounds are *fair*: a round is short and takes
jobs only of those contexts that have used the least processor time lately (module ``accounts``), one job of each in
turn.  So a context with a single short job waits for one turn of others, not for the thousands of jobs that another
context may have, and it is answered several times in a row before a context whose turns are long has its next.  The
jobs of one context keep their order.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from urbihw.kernel.sched.accounts import Accounts
    from urbihw.kernel.sched.job import Job

MAX_FAIR_ROUND: Final = 20
"""The number of jobs at which a fair round is full.  It takes one job of each of its contexts in any case."""
SAME_S: Final = 0.001
"""Contexts whose accounts differ by less than so many seconds take turns in one round."""


class Mark:
    """An entry of the ready queue that is no job; it has the attributes of jobs that are tested before a switch."""

    carrier = None
    charged_context = None
    frozen = False
    started = True


INTERRUPT = Mark()
"""Makes ``Scheduler.yield_`` return to the hub although only one job is ready: ``run`` has been interrupted."""
TURN_END = Mark()
"""Stands between the turns of different contexts in a fair round."""
ROUND_END = Mark()
"""The end of a fair round that left jobs out: behind it stand the jobs that became ready in that round."""


class ReadyQueue:
    """The ready jobs of one scheduler.

    Attributes:
        jobs: the queue that ``Scheduler.run`` works off; the scheduler appends to it directly.
        is_fair: whether the next round is a fair one.
        preferred: the job that was last preferred in this round, with the job that made it and its index in ``jobs``.
    """

    __slots__ = ("_accounts", "_waiting", "is_fair", "jobs", "preferred")

    def __init__(self, accounts: Accounts) -> None:
        self._accounts = accounts
        self.jobs: deque[Job | Mark] = deque()
        self.is_fair = False
        self.preferred: tuple[Job | None, int, Job] | None = None
        self._waiting: dict[Any, deque[Job]] = {}

    def remove(self, made: Job) -> None:
        """Remove a job that was just spawned; it is the last entry unless a thread has interrupted ``run``."""
        if self.jobs[-1] is made:
            self.jobs.pop()
        else:
            self.jobs.remove(made)

    def prefer(self, made: Job, maker: Job | None) -> None:
        """Move a job that was just spawned before the started jobs of its context, behind the jobs not yet started."""
        self.remove(made)
        ready = self.jobs
        place = 0
        if self.preferred is not None:  # a job may prefer thousands in one turn: no search then
            last_maker, at, last = self.preferred
            if last_maker is maker and at < len(ready) and ready[at] is last and not last.started:
                place = at + 1
        while place < len(ready):  # another thread may append meanwhile
            waiting = ready[place]
            if waiting is ROUND_END:
                self._prefer_waiting(made)
                return
            if waiting is INTERRUPT or _is_of(waiting, made.charged_context) and waiting.started:
                break
            place += 1
        ready.insert(place, made)
        self.preferred = (maker, place, made)

    def put_first(self, context: Any, *jobs: Job) -> None:
        """Put jobs before all others of a context, in this order.

        In a fair round they do not take the turns of other contexts: a job that forks, and whose children fork at once,
        would have the round to itself.
        """
        ready = self.jobs
        place = 0
        if self._waiting:
            while ready[place] is not ROUND_END and not _is_of(ready[place], context):
                place += 1
            if ready[place] is ROUND_END:
                self._waiting.setdefault(context, deque()).extendleft(reversed(jobs))
                return
        for job in reversed(jobs):
            ready.insert(place, job)

    def _prefer_waiting(self, made: Job) -> None:
        """Put a new job before the started jobs of its context that are left out of the present round."""
        queue = self._waiting.setdefault(made.charged_context, deque())
        place = 0
        while place < len(queue) and not queue[place].started:
            place += 1
        queue.insert(place, made)

    def begin_round(self) -> int:
        """Begin a round, and return the number of its entries at the head of ``jobs``."""
        self.preferred = None
        if not self.is_fair:
            return len(self.jobs)
        self._accounts.skip()
        return self._begin_fair_round()

    def _begin_fair_round(self) -> int:
        """Reduce ``jobs`` to one fair round, and return the number of its entries: jobs, and ends of turns.

        ``ROUND_END`` follows if jobs are left out.
        """
        self._line_up()
        waiting, ready = self._waiting, self.jobs
        ranks = {context: self._accounts.rank(context) for context in waiting}
        lowest = min(ranks.values(), default=(0.0, 0))[0]
        same = [context for context in ranks if ranks[context][0] <= lowest + SAME_S]
        turns = dict.fromkeys(sorted(same, key=lambda context: ranks[context][1]))
        number = 0
        while turns and number < MAX_FAIR_ROUND:
            for context in list(turns):
                if number and len(same) > 1:
                    ready.append(TURN_END)
                queue = waiting[context]
                ready.append(queue.popleft())
                number += 1
                if not queue:
                    del waiting[context], turns[context]
        entries = len(ready)
        self.is_fair = bool(waiting)
        if waiting:
            ready.append(ROUND_END)
        return entries

    def _line_up(self) -> None:
        """Let all jobs wait in the lines of their contexts; those that the last round left without a turn go first."""
        ready, waiting = self.jobs, self._waiting
        come: list[Job] = []
        left: list[Job] = []
        while ready:
            one = ready.popleft()
            if one is ROUND_END:
                left, come = come, []
            elif not isinstance(one, Mark):
                come.append(one)
        for job in left:
            waiting.setdefault(job.charged_context, deque())
        for job in reversed(left):
            waiting[job.charged_context].appendleft(job)
        for job in come:
            waiting.setdefault(job.charged_context, deque()).append(job)


def _is_of(entry: Job | Mark, context: Any) -> bool:
    """Whether an entry of the queue is a job of a context."""
    return not isinstance(entry, Mark) and entry.charged_context is context
