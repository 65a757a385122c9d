"""What a bus of servos does with its time, measured from its traffic: bytes, turnaround of each device, idle share.

The turnaround of a device is the time from the end of the request on the wire to its answer, without the time that the
bytes of the answer take: the return delay of the servo, the delay of the adapter, and that of the system. No I/O.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from statistics import median
from typing import Final

from urbihw.buses.trace import Chunk, TraceDecoder, TracedPacket

_ANSWERS: Final = "status"
_NO_ANSWER: Final = "no answer"


class BusMeter:
    """Measures one bus.

    Attributes:
        written, read: bytes.
        damaged: answers with a wrong checksum, and runs of bytes that are no packet.
        silent: device -> how often it has not answered.
    """

    def __init__(self, decoder: TraceDecoder, byte_time: float) -> None:
        """`byte_time`: seconds that a byte takes on the wire."""
        self.written = self.read = self.damaged = 0
        self.silent: dict[str, int] = defaultdict(int)
        self._decoder = decoder
        self._byte_time = byte_time
        self._times: dict[str, list[float]] = defaultdict(list)
        self._begin: float | None = None
        self._end = self._free_at = 0.0

    def add_all(self, chunks: Iterable[Chunk], *, is_cut_off: bool = False) -> None:
        """Add all chunks of a recording; of one that is cut off, the last question may still have been answered."""
        for chunk in chunks:
            self.add(chunk)
        self._count(packet for packet in self._decoder.flush() if not (is_cut_off and packet.what == _NO_ANSWER))

    def add(self, chunk: Chunk) -> None:
        """Add a chunk of the traffic."""
        if self._begin is None:
            self._begin = chunk.time
        self._end = max(self._end, chunk.time)
        packets = self._decoder.feed(chunk)
        self._count(packets)
        if chunk.direction == ">":
            self.written += len(chunk.data)
            self._free_at = max(chunk.time, self._free_at) + len(chunk.data) * self._byte_time
            return
        self.read += len(chunk.data)
        answers = [packet for packet in packets if packet.what == _ANSWERS]
        if answers:
            # Several answers in one chunk: their times are not known apart.
            size = sum(len(packet.data) for packet in answers)
            late = max(chunk.time - self._free_at - size * self._byte_time, 0.0) / len(answers)
            for packet in answers:
                self._times[packet.device].append(late)
            self._free_at = chunk.time

    def _count(self, packets: Iterable[TracedPacket]) -> None:
        for packet in packets:
            self.damaged += packet.what == "?"
            if packet.what == _NO_ANSWER:
                self.silent[packet.device] += 1

    @property
    def seconds(self) -> float:
        """The time from the first chunk to the last."""
        return self._end - self._begin if self._begin is not None else 0.0

    @property
    def busy(self) -> float:
        """The share of the time in which the wire carries bytes, 0..1."""
        total = (self.written + self.read) * self._byte_time
        return min(total / self.seconds, 1.0) if self.seconds else 0.0

    def turnarounds(self) -> dict[str, float]:
        """Return device -> median of its turnaround in seconds."""
        return {device: median(times) for device, times in self._times.items()}
