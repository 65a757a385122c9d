"""The last minutes of a robot, in memory: written to a file only when something has gone wrong, or on request.

Nothing is written meanwhile, which is kind to the SD card of a small computer. Each second is packed when it is over.
"""

from __future__ import annotations

import marshal
import zlib
from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

from urbihw.recording.records import TopicRecord

MOST_BYTES: Final = 48 << 20
"""Packed bytes at most."""
MOST_SECOND_BYTES: Final = 4 << 20
"""Bytes of one second at most: what is more is packed at once."""
_LEVEL: Final = 1


class _PackedSecond(NamedTuple):
    """The records of a second: when the last of them was added, and their packed bytes."""

    time: float
    data: bytes


class FlightMemory:
    """Keeps the records of the last ``seconds``, in ``most`` bytes."""

    def __init__(self, seconds: float, most: int = MOST_BYTES) -> None:
        self._seconds = seconds
        self._most = most
        self._packed: deque[_PackedSecond] = deque()
        self._fresh: list[tuple[str, float, bytes]] = []
        self._fresh_size = 0
        self._size = 0
        self._begun_at = 0.0

    @property
    def size(self) -> int:
        """Bytes that are kept."""
        return self._size + self._fresh_size

    def add(self, record: TopicRecord) -> None:
        """Add a record to the present second."""
        self._fresh.append((record.topic, record.time, record.data))
        self._fresh_size += len(record.data)
        if self._fresh_size > MOST_SECOND_BYTES:
            self._pack(self._begun_at)

    def keep(self, now: float) -> None:
        """Call this a few times a second: it packs what is a second old and forgets what is too old."""
        if now - self._begun_at >= 1.0:
            self._pack(now)
            self._begun_at = now
        while self._packed and now - self._packed[0].time > self._seconds:
            self._forget_oldest()

    def seconds(self) -> Iterator[list[TopicRecord]]:
        """Yield what is kept, in the order in which it was added: a second at a time, ``MOST_SECOND_BYTES`` at most.

        Only one second is unpacked at a time.
        """
        for second in tuple(self._packed):
            yield [TopicRecord(*row) for row in marshal.loads(zlib.decompress(second.data))]
        yield [TopicRecord(*row) for row in self._fresh]

    def _pack(self, now: float) -> None:
        if not self._fresh:
            return
        data = zlib.compress(marshal.dumps(self._fresh), _LEVEL)
        self._packed.append(_PackedSecond(now, data))
        self._size += len(data)
        self._fresh.clear()
        self._fresh_size = 0
        while self._size > self._most and len(self._packed) > 1:
            self._forget_oldest()

    def _forget_oldest(self) -> None:
        self._size -= len(self._packed.popleft().data)
