"""An in-memory link for tests: `pipe://name`, with wire time but without waiting.

The far end is a `PipeEnd`, registered by name in `Context.pipes`. Bytes take as long as on a wire of the given speed:
the far end gets the arrival time of the last byte of a message, and gives a time from which its own bytes are
readable. On a `SimClock` waiting is a jump, so a whole robot runs in simulated time in one thread.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable

from urbihw.buses.errors import LinkGone, Unavailable
from urbihw.buses.link import Context, Link, Url


class PipeEnd:
    """The far end of a `pipe://` link: what a test or a fake device holds.

    Attributes:
        on_receive: called with (data, time its last byte arrived) for each write of the link.
        on_open, on_close: called when a link opens or closes it, for a peer that has connections.
    """

    def __init__(self, on_receive: Callable[[bytes, float], None] | None = None) -> None:
        self.on_receive = on_receive
        self.on_open: Callable[[], None] = lambda: None
        self.on_close: Callable[[], None] = lambda: None
        self.connection = 0
        self._plugged = True
        self._order = itertools.count()
        self._inbox: list[tuple[float, int, bytes]] = []

    def accept(self) -> PipeEnd:
        """Return the end of a link that opens now: a peer that takes several links at a time has one for each."""
        self.on_open()
        return self

    def send(self, data: bytes, at: float) -> None:
        """Let `data` become readable at the link at time `at` (all of it together)."""
        if data:
            heapq.heappush(self._inbox, (at, next(self._order), data))

    def hang_up(self) -> None:
        """Make every use of the links that are open fail, until they are opened anew; bytes under way are lost."""
        self.connection += 1
        self._inbox.clear()

    def unplug(self) -> None:
        """Make every use of the link fail until `replug`; bytes under way are lost."""
        self._plugged = False
        self._inbox.clear()

    def replug(self) -> None:
        """Let links be opened again."""
        self._plugged = True

    @property
    def plugged(self) -> bool:
        """False between `unplug` and `replug`."""
        return self._plugged

    def read_arrived(self, size: int, now: float) -> bytes:
        """Return at most `size` bytes that have arrived by `now`."""
        parts = b""
        while self._inbox and self._inbox[0][0] <= now and len(parts) < size:
            at, order, data = heapq.heappop(self._inbox)
            room = size - len(parts)
            parts += data[:room]
            if data[room:]:
                heapq.heappush(self._inbox, (at, order, data[room:]))
        return parts

    def next_arrival(self) -> float | None:
        """Return when the next bytes become readable, None when nothing is under way."""
        return self._inbox[0][0] if self._inbox else None


class PipeLink(Link):
    """The near end: an ordinary link."""

    _end: PipeEnd | None = None
    _wire_free_at = 0.0
    _connection = 0

    def __init__(self, url: Url, context: Context) -> None:
        super().__init__(url, context)
        self._pipes = context.pipes

    def _open(self) -> None:
        end = self._pipes.get(self.url.target)
        if end is None:
            raise Unavailable(f"no such pipe: {self.url.target}; known: {', '.join(sorted(self._pipes)) or 'none'}")
        if not end.plugged:
            raise Unavailable(f"pipe {self.url.target} is unplugged")
        self._end = end.accept()
        self._connection = self._end.connection

    def _close(self) -> None:
        end, self._end = self._end, None
        if end is not None:
            end.on_close()

    def _read(self, size: int, deadline: float) -> bytes:
        end = self._plugged_end()
        arrival = end.next_arrival()
        self.clock.sleep_until(deadline if arrival is None else min(arrival, deadline))
        return self._plugged_end().read_arrived(size, self.clock.now())

    def _write(self, data: bytes) -> None:
        end = self._plugged_end()
        start = max(self.clock.now(), self._wire_free_at)
        self._wire_free_at = start + len(data) * self.byte_time
        if end.on_receive is not None:
            end.on_receive(data, self._wire_free_at)

    def _plugged_end(self) -> PipeEnd:
        if self._end is None or not self._end.plugged:
            raise LinkGone(f"{self.url.text}: unplugged")
        if self._end.connection != self._connection:
            raise LinkGone(f"{self.url.text}: the other side closed")
        return self._end
