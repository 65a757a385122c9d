"""Timers in a heap of deadlines.  A cancelled timer stays in the heap until its time comes, and is then skipped.  When
more than half of the timers are cancelled, the heap is rebuilt, so that frequent cancelling does not use up memory.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable

from urbihw.kernel import errors


class Timer:
    """A function to be called once at a time, unless ``cancel()`` is called before."""

    __slots__ = ("_queue", "action", "deadline")

    def __init__(self, deadline: float, action: Callable[[], None], queue: TimeQueue) -> None:
        self.deadline = deadline
        self.action: Callable[[], None] | None = action
        self._queue = queue

    def cancel(self) -> None:
        """Cancel the call; does nothing after the call."""
        if self.action is not None:
            self.action = None
            self._queue.count_cancelled()


class TimeQueue:
    """Timers in the order of their deadlines; timers with the same deadline in the order in which they were added."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Timer]] = []  # Python compares tuples faster than objects
        self._order = 0
        self._cancelled = 0
        self.soonest = math.inf
        """No timer is due before this time.  Kept up to date, because the scheduler reads it in each round."""

    def __len__(self) -> int:
        return len(self._heap) - self._cancelled

    def add(self, deadline: float, action: Callable[[], None]) -> Timer:
        """Call ``action`` at ``deadline``, in seconds.

        Raises BadNumber if the deadline is NaN: NaN has no place in an order, and the timer would never be due.
        """
        if deadline != deadline:
            raise errors.bad_number("BadNumber", "expected a duration, got nan")
        self._order += 1
        timer = Timer(deadline, action, self)
        heapq.heappush(self._heap, (deadline, self._order, timer))
        if deadline < self.soonest:
            self.soonest = deadline
        return timer

    def count_cancelled(self) -> None:
        """Count a cancelled timer; rebuild the heap if most timers are cancelled."""
        self._cancelled += 1
        if self._cancelled > 64 and self._cancelled * 2 > len(self._heap):
            self._heap = [entry for entry in self._heap if entry[2].action is not None]
            heapq.heapify(self._heap)
            self._cancelled = 0

    def next_deadline(self) -> float | None:
        """The deadline of the first timer, or None."""
        heap = self._heap
        while heap and heap[0][2].action is None:
            heapq.heappop(heap)
            self._cancelled -= 1
        if not heap:
            self.soonest = math.inf
            return None
        self.soonest = heap[0][0]
        return self.soonest

    def pop_due(self, now: float) -> Callable[[], None] | None:
        """Remove the first timer that is due at ``now`` and return its action, None if it was cancelled or none is
        due.
        """
        deadline = self.next_deadline()
        if deadline is None or deadline > now:
            return None
        timer = heapq.heappop(self._heap)[2]
        action, timer.action = timer.action, None
        self.next_deadline()
        return action
