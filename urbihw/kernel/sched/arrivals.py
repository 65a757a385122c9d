"""When the input of a connection was ordered: text may wait for long before it runs, and is no newer for that.

A stop of a robot divides the time into eras (``Scheduler.era``).  A statement that runs after the release of an
emergency stop may have been sent before the stop: behind ``sleep(10s);``, or at the end of a long text.  So each byte
has the era in which it arrived, or in which the program began that typed it (``Job.ordered``).

What has arrived waits in two places: unread (``UnreadInput``), then read, before earlier statements (``Arrivals``).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable


class Arrivals:
    """The bytes of an input that wait, as numbers of bytes that were ordered together; the oldest are the first."""

    def __init__(self) -> None:
        self._parts: deque[tuple[int, int]] = deque()

    def add(self, size: int, ordered: int) -> None:
        """So many bytes more wait, which were ordered then."""
        if self._parts and self._parts[-1][1] == ordered:
            size += self._parts.pop()[0]
        if size:
            self._parts.append((size, ordered))

    @property
    def together(self) -> int:
        """The number of bytes that come first and were ordered together."""
        return self._parts[0][0] if self._parts else 0

    def take(self, size: int) -> int:
        """Remove so many bytes, at least one; return the oldest of their orders."""
        orders = []
        while size > 0:
            there, ordered = self._parts.popleft()
            orders.append(ordered)
            if there > size:
                self._parts.appendleft((there - size, ordered))
            size -= there
        return min(orders)

    def renew(self, since: int, ordered: int) -> None:
        """Let what was ordered at ``since`` or later count as ordered at ``ordered``."""
        self._parts = deque((size, renewed(old, since, ordered)) for size, old in self._parts)

    def clear(self) -> None:
        """Nothing waits any more."""
        self._parts.clear()


class UnreadInput:
    """The unread input of one client, and its era.  A socket carries this object from its accept on.

    Attributes:
        paused: whether nothing is read at present, because the client sends more than runs.
    """

    def __init__(self, size: Callable[[], int] = lambda: 0) -> None:
        """``size`` returns the number of bytes that have arrived and are not read."""
        self._size = size
        self.paused = False
        self._older: int | None = None
        """The era of bytes that had arrived when it ended, and are not read yet; None if there are none."""
        self._behind = False
        """Whether what is read may have been sent long ago, since reading has paused."""

    def pause(self) -> None:
        """Nothing is read from now on, until ``resume``."""
        self.paused = self._behind = True

    def resume(self) -> None:
        """What waits is read again, oldest first."""
        self.paused = False

    def end_era(self, era: int) -> None:
        """This era ends: what is not read yet belongs to it, and so does what is on its way because reading pauses."""
        if self._older is None and (self.paused or self._size()):
            self._older = era

    def read(self, era: int, caught_up: bool) -> tuple[int, bool]:
        """Bytes were just read, in an era; ``caught_up``: all that was read before has run.

        Return the era in which they arrived, and whether they were sent lately: the client is there and sends.
        """
        if caught_up:
            self._behind = False
        arrived, lately = era if self._older is None else self._older, not self._behind
        if not self._behind and not self._size():
            self._older = None
        return arrived, lately

    def renew(self, since: int, ordered: int) -> None:
        """Let what arrived at ``since`` or later count as arrived at ``ordered``."""
        if self._older is not None:
            self._older = renewed(self._older, since, ordered)


def renewed(old: int, since: int, ordered: int) -> int:
    """The order of one that was ordered at ``old``, when all those from ``since`` on are ordered again."""
    return ordered if old >= since else old
