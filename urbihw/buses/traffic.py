"""The bytes on a worker's wire, collected for those who ask for them by the control socket (``trace``, ``record``).

Nothing is collected as long as no client listens: a port then has no observer. What waits is bounded; more is
dropped, the oldest first, and counted. Connections that a driver opens beside its port (`Port.twin`) are not seen.

The first seconds of a link are kept for recorders that come later: without the search for the devices no recording
could be played to a driver.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, is_dataclass
from typing import Any, Final

from urbihw.buses.clock import BusClock
from urbihw.buses.link import Port
from urbihw.buses.messages import Found, FromWorker

MOST_CHUNKS: Final = 2000
"""Chunks that are collected in one tick."""
MOST_BYTES: Final = 1 << 18
"""Their bytes."""


OPENING_S: Final = 5.0
"""Seconds after a link was opened whose bytes are kept."""
MOST_OPENING_BYTES: Final = 1 << 17
MOST_OPENING_ROWS: Final = 20_000
OPENING_ROWS: Final = 200
"""Chunks of them in one event."""

Row = tuple[float, str, bytes]
"""When bytes were moved, in which direction, and which."""


class TrafficLog:
    """Collects what one port moves, between two calls of `take`."""

    def __init__(self, url: str, clock: BusClock) -> None:
        self._url = url
        self._clock = clock
        self._devices: list[dict[str, Any]] = []
        self._chunks: deque[Row] = deque()
        self._size = 0
        self._lost = 0
        self._wanted = False
        self._opening: list[Row] = []
        self._opening_size = 0
        self._opening_lost = 0
        self._opening_until = 0.0

    def hear(self, message: FromWorker) -> None:
        """Note which devices were found: who decodes the bytes must know their models."""
        if isinstance(message, Found):
            self._devices = [asdict(device) for device in message.devices if is_dataclass(type(device))]

    def fields(self, port: Port | None) -> dict[str, Any]:
        """Return what a client must know to decode the bytes: url, devices, and bits per second on the wire."""
        return {
            # What stands behind `?` may be a password.
            "url": self._url.partition("?")[0],
            "devices": self._devices,
            "baud": 0 if port is None else port.baud,
        }

    def begin(self, port: Port) -> None:
        """Keep what a port that was just opened moves in its first seconds."""
        self._opening, self._opening_size, self._opening_lost = [], 0, 0
        self._opening_until = self._clock.now() + OPENING_S
        port.observer = self._add

    def observe(self, port: Port | None, wanted: bool) -> None:
        """Collect from a port for those who listen, or no longer."""
        if self._wanted and not wanted:
            self._chunks.clear()
            self._size = self._lost = 0
        self._wanted = wanted
        needed = wanted or self._clock.now() < self._opening_until
        if port is not None and (port.observer is not None) != needed:
            port.observer = self._add if needed else None

    def take(self) -> dict[str, Any] | None:
        """Return the event with what was collected, None for nothing; the next one begins."""
        if not self._chunks:
            return None
        event = _event(self._chunks, self._lost)
        self._chunks.clear()
        self._size = self._lost = 0
        return event

    def opening(self) -> Iterator[dict[str, Any]]:
        """Return the first seconds of the link, without what the next `take` returns, as events to be sent one a tick:
        to make all of them at once would take longer than a tick. What had no room is counted in one more event."""
        fresh = {id(row) for row in self._chunks}
        rows = [row for row in self._opening if id(row) not in fresh]
        events: list[tuple[Sequence[Row], int]] = [(part, 0) for part in _batched(rows, OPENING_ROWS)]
        if self._opening_lost:
            events.append(([], self._opening_lost))
        return ({**_event(part, lost), "opening": True} for part, lost in events)

    def _add(self, direction: str, data: bytes) -> None:
        row = (self._clock.now(), direction, data)
        if row[0] < self._opening_until:
            self._add_opening(row)
        if not self._wanted:
            return
        self._chunks.append(row)
        self._size += len(data)
        while len(self._chunks) > MOST_CHUNKS or (self._size > MOST_BYTES and len(self._chunks) > 1):
            self._size -= len(self._chunks.popleft()[2])
            self._lost += 1

    def _add_opening(self, row: Row) -> None:
        """Keep a row of the first seconds. Behind the first one without room none is kept, so that there is no gap."""
        size = self._opening_size + len(row[2])
        if self._opening_lost or size > MOST_OPENING_BYTES or len(self._opening) >= MOST_OPENING_ROWS:
            self._opening_lost += 1
            return
        self._opening.append(row)
        self._opening_size = size


def _event(rows: Iterable[Row], lost: int) -> dict[str, Any]:
    chunks = [[round(time, 6), direction, data.hex()] for time, direction, data in rows]
    return {"event": "Traffic", "chunks": chunks, "lost": lost}


def _batched(rows: Sequence[Row], size: int) -> Iterator[Sequence[Row]]:
    """Yield the rows in parts of a size."""
    return (rows[begin : begin + size] for begin in range(0, len(rows), size))
