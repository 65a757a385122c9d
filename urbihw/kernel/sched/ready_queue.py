"""The ready queue: in which order the ready jobs get their turns.

Usually all ready jobs stand in one queue, first in first out, whatever context they belong to.  When a round of all of
them takes too long, ``Scheduler.run`` has to interrupt it.  From then on rounds are *fair*: a round is short and takes
one job of each context in turn.  So a context with a single job waits for one job of each other context, not for the
thousands of jobs that another context may have.  The jobs of one context keep their order.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job

MAX_FAIR_ROUND = 20
"""The number of jobs at which a fair round is full.  It takes one job of each context in any case."""


class Mark:
    """An entry of the ready queue that is no job; it has the attributes of jobs that are tested before a switch."""

    carrier = None
    charged_context = None
    frozen = False
    started = True


INTERRUPT = Mark()
"""Makes ``Scheduler.yield_`` return to the hub although only one job is ready: ``run`` has been interrupted."""
ROUND_END = Mark()
"""The end of a fair round that left jobs out: behind it stand the jobs that became ready in that round."""


class ReadyQueue:
    """The ready jobs of one scheduler.

    Attributes:
        jobs: the queue that ``Scheduler.run`` works off; the scheduler appends to it directly.
        is_fair: whether the next round is a fair one.
        preferred: the job that was last preferred in this round, with the job that made it and its index in ``jobs``.
    """

    __slots__ = ("_waiting", "is_fair", "jobs", "preferred")

    def __init__(self) -> None:
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
            if isinstance(waiting, Mark) or (waiting.started and waiting.charged_context is made.charged_context):
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
            while ready[place] is not ROUND_END and (
                ready[place] is INTERRUPT or ready[place].charged_context is not context
            ):
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

    def begin_fair_round(self) -> int:
        """Reduce ``jobs`` to one fair round, and return the number of its jobs.

        The contexts take turns in the order in which they have waited.  ``ROUND_END`` follows if jobs are left out.
        """
        ready = self.jobs
        waiting = self._waiting
        come: list[Job] = []
        left: list[Job] = []
        while ready:
            one = ready.popleft()
            if one is ROUND_END:
                left, come = come, []
            elif not isinstance(one, Mark):
                come.append(one)
        turns = {job.charged_context: None for job in left}
        for job in reversed(left):
            waiting.setdefault(job.charged_context, deque()).appendleft(job)
        for job in come:
            waiting.setdefault(job.charged_context, deque()).append(job)
        turns.update(dict.fromkeys(waiting))
        number = 0
        while waiting and number < MAX_FAIR_ROUND:
            for context in list(turns):
                queue = waiting[context]
                ready.append(queue.popleft())
                number += 1
                if not queue:
                    del waiting[context], turns[context]
        self.is_fair = bool(waiting)
        if waiting:
            ready.append(ROUND_END)
        return number
