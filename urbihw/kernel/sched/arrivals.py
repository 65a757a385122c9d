"""When the input of a connection was ordered: text may wait for long before it runs, and is no newer for that.

A stop of a robot divides the time into eras (``Scheduler.era``).  A statement that runs after the release of an
emergency stop may have been sent before the stop: behind ``sleep(10s);``, or at the end of a long text.  So each byte
has the era in which it arrived, or in which the program began that typed it (``Job.ordered``).
"""

from __future__ import annotations

from collections import deque


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


def renewed(old: int, since: int, ordered: int) -> int:
    """The order of one that was ordered at ``old``, when all those from ``since`` on are ordered again."""
    return ordered if old >= since else old
