"""Who wakes when: a heap of deadlines.  A cancelled timer stays in the heap until its time and is then skipped;
when more than half of the heap is such litter it is rebuilt, so that cancelling often does not grow memory."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable

from urbihw.kernel import errors


class Timer:
    """A promise to call something once at a time; ``cancel()`` takes it back."""

    __slots__ = ("_queue", "action", "deadline", "order")

    def __init__(self, deadline: float, order: int, action: Callable[[], None], queue: TimeQueue) -> None:
        self.deadline = deadline
        self.order = order
        self.action: Callable[[], None] | None = action
        self._queue = queue

    def __lt__(self, other: Timer) -> bool:
        return (self.deadline, self.order) < (other.deadline, other.order)

    def cancel(self) -> None:
        """Take the promise back; harmless when it was kept already."""
        if self.action is not None:
            self.action = None
            self._queue.forget()


class TimeQueue:
    """Timers in the order of their deadlines, first come first served among equals."""

    def __init__(self) -> None:
        self._heap: list[Timer] = []
        self._order = 0
        self._cancelled = 0
        self.soonest = math.inf
        """No timer is due before this time; asked at every round, so it is kept and not computed."""

    def __len__(self) -> int:
        return len(self._heap) - self._cancelled

    def add(self, deadline: float, action: Callable[[], None]) -> Timer:
        """Call ``action`` when ``pop_due`` is told a time at or after ``deadline``.

        Raises BadNumber for what is no number: it comes neither before nor after anything, and would never be due.
        """
        if deadline != deadline:
            raise errors.bad_number("BadNumber", "expected a duration, got nan")
        self._order += 1
        timer = Timer(deadline, self._order, action, self)
        heapq.heappush(self._heap, timer)
        self.soonest = min(self.soonest, deadline)
        return timer

    def forget(self) -> None:
        """One timer was cancelled."""
        self._cancelled += 1
        if self._cancelled > 64 and self._cancelled * 2 > len(self._heap):
            self._heap = [timer for timer in self._heap if timer.action is not None]
            heapq.heapify(self._heap)
            self._cancelled = 0

    def next_deadline(self) -> float | None:
        """When the first timer is due, or None."""
        while self._heap and self._heap[0].action is None:
            heapq.heappop(self._heap)
            self._cancelled -= 1
        if not self._heap:
            self.soonest = math.inf
            return None
        self.soonest = self._heap[0].deadline
        return self.soonest

    def pop_due(self, now: float) -> Callable[[], None] | None:
        """Take the first action that is due at ``now``, or None."""
        deadline = self.next_deadline()
        if deadline is None or deadline > now:
            return None
        timer = heapq.heappop(self._heap)
        action, timer.action = timer.action, None
        self.next_deadline()
        return action
