"""Fair turns when there are so many ready jobs that a round of all of them takes too long.

Usually all ready jobs stand in one queue, first in first out, whoever they belong to.  When a round had to be
interrupted, the queue is shared out: rounds are short then, and have one job of each context in turn.  So somebody with
a single job waits for one job of each of the others, not for the thousands that one of them may have.  The jobs of one
context stay in their order.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job

ENOUGH = 20
"""A round has no further job of any context once it has so many; one of each context it always has."""


class Mark:
    """Stands in the ready queue between jobs."""

    carrier = None
    frozen = False


REST = Mark()
"""Behind it stand those that became ready in this round; before it, those of the round that have not had their turn."""


class Crowd:
    """The jobs that are ready and not in the round."""

    def __init__(self) -> None:
        self._waiting: dict[Any, deque[Job]] = {}

    def share_out(self, ready: deque[Job | Mark]) -> int:
        """Make the next round, the contexts in the order in which they have waited; the number of its jobs.

        ``REST`` is put behind them if there are more.
        """
        waiting = self._waiting
        come: list[Job] = []
        left: list[Job] = []
        while ready:
            one = ready.popleft()
            if one is REST:
                left, come = come, []
            elif not isinstance(one, Mark):
                come.append(one)
        turns = {job.payer: None for job in left}
        for job in reversed(left):
            waiting.setdefault(job.payer, deque()).appendleft(job)
        for job in come:
            waiting.setdefault(job.payer, deque()).append(job)
        turns.update(dict.fromkeys(waiting))
        number = 0
        while waiting and number < ENOUGH:
            for context in list(turns):
                queue = waiting[context]
                ready.append(queue.popleft())
                number += 1
                if not queue:
                    del waiting[context], turns[context]
        if waiting:
            ready.append(REST)
        return number

    def prefer(self, made: Job) -> None:
        """Put a new job before those of its context that have begun."""
        queue = self._waiting.setdefault(made.payer, deque())
        place = 0
        while place < len(queue) and not queue[place].started:
            place += 1
        queue.insert(place, made)
