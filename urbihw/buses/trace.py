"""Decoding of recorded or live traffic: bytes in, one packet a line out; no I/O and no clock.

A decoder belongs to a protocol family; each platform names its own in its manifest (``trace``). It gets chunks of bytes
as they were written and read, with their times, and returns packets. Nothing that comes raises: what is no packet
becomes a packet with a ``problem``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Literal, NamedTuple

from urbihw.frozen import frozen

Direction = Literal[">", "<"]
"""``>`` to the robot, ``<`` from it."""
Check = Literal["", "ok", "bad"]
"""The verdict on a checksum; "" where the protocol has none."""
_SHOWN_BYTES: Final = 16
_MOST_NOISE: Final = 4096
"""Bytes without a packet that are shown together."""
_NOISE_S: Final = 1.0
"""Seconds of bytes without a packet that are shown together: a wrong speed becomes visible."""


class Chunk(NamedTuple):
    """Bytes as they were written or read at one time, in seconds; of a CAN bus a frame: identifier (2), data."""

    time: float
    direction: Direction
    data: bytes


@frozen
class TracedPacket:
    """One packet.

    Attributes:
        time: when its first byte came, in seconds.
        direction: ``>`` to the robot, ``<`` from it.
        device: which device it is for or from, "" where there is only one.
        what: the instruction, or the kind of answer.
        detail: names and values, in SI units and raw.
        check: the verdict on its checksum.
        problem: what is wrong: an error that the device tells, damaged or missing bytes; "" for nothing.
        data: the bytes of the packet, b"" where they must not be shown.
    """

    time: float
    direction: Direction
    device: str
    what: str
    detail: str = ""
    check: Check = ""
    problem: str = ""
    data: bytes = b""


class TraceDecoder(ABC):
    """Decodes the traffic of one wire."""

    @abstractmethod
    def feed(self, chunk: Chunk) -> list[TracedPacket]:
        """Return the packets that this chunk completes."""

    def flush(self) -> list[TracedPacket]:
        """Return what is left at the end of the traffic."""
        return []


MakeDecoder = Callable[[Sequence[Mapping[str, Any]]], TraceDecoder]
"""Makes a decoder; the argument are the known devices, with the fields of the family's ``Found``, () if none."""


class Cut(NamedTuple):
    """How a stream begins: with a packet of ``size`` bytes, or (``noise``) with so many bytes outside a packet."""

    size: int
    noise: bool = False


class _Direction:
    """The bytes of one direction that are not decoded yet, with the times at which they came."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.noise = bytearray()
        self.noise_time = 0.0
        self._marks: deque[list[float]] = deque()

    def add(self, chunk: Chunk) -> None:
        if chunk.data:
            self.data += chunk.data
            self._marks.append([len(chunk.data), chunk.time])

    def take(self, size: int) -> tuple[float, bytes]:
        """Remove bytes; return the time of the first and the bytes."""
        taken = bytes(self.data[:size])
        del self.data[:size]
        time = self._marks[0][1] if self._marks else 0.0
        while size and self._marks:
            part = min(size, int(self._marks[0][0]))
            size -= part
            self._marks[0][0] -= part
            if not self._marks[0][0]:
                self._marks.popleft()
        return time, taken


class StreamDecoder(TraceDecoder):
    """Base for protocols on a stream: cuts each direction into packets.

    A subclass implements ``cut`` and ``decode``. With ``half_duplex`` a packet ends at the latest when the other
    direction begins.
    """

    half_duplex = False

    def __init__(self) -> None:
        self._streams: dict[Direction, _Direction] = {">": _Direction(), "<": _Direction()}

    @abstractmethod
    def cut(self, direction: Direction, data: bytearray) -> Cut | None:
        """Return how these bytes begin, None if more are needed to tell."""

    @abstractmethod
    def decode(self, time: float, direction: Direction, data: bytes) -> list[TracedPacket]:
        """Return the packets of the bytes of one, usually one."""

    def feed(self, chunk: Chunk) -> list[TracedPacket]:
        """Return the packets that this chunk completes."""
        found = self._end("<" if chunk.direction == ">" else ">") if self.half_duplex else []
        self._streams[chunk.direction].add(chunk)
        return found + self._cut_all(chunk.direction)

    def flush(self) -> list[TracedPacket]:
        """Return what is left at the end of the traffic."""
        return self._end(">") + self._end("<")

    def _cut_all(self, direction: Direction) -> list[TracedPacket]:
        stream, found = self._streams[direction], []
        while stream.data and (piece := self.cut(direction, stream.data)) is not None:
            time, data = stream.take(max(piece.size, 1))
            if piece.noise:
                self._add_noise(stream, time, data)
                if len(stream.noise) >= _MOST_NOISE or time - stream.noise_time >= _NOISE_S:
                    found += self._noise_packets(direction)
                continue
            found += self._noise_packets(direction)
            found += self.decode(time, direction, data)
        return found

    def _end(self, direction: Direction) -> list[TracedPacket]:
        """Return what is left of a direction that ends here."""
        stream, found = self._streams[direction], []
        while stream.data:
            # The beginning of a packet whose end did not come; a whole one may stand behind it.
            self._add_noise(stream, *stream.take(1))
            found += self._cut_all(direction)
        return found + self._noise_packets(direction)

    @staticmethod
    def _add_noise(stream: _Direction, time: float, data: bytes) -> None:
        if not stream.noise:
            stream.noise_time = time
        stream.noise += data

    def _noise_packets(self, direction: Direction) -> list[TracedPacket]:
        stream = self._streams[direction]
        if not stream.noise:
            return []
        data = bytes(stream.noise)
        stream.noise.clear()
        problem = f"{len(data)} bytes are no packet"
        return [TracedPacket(stream.noise_time, direction, "", "?", hex_of(data), problem=problem, data=data)]


class FrameDecoder(TraceDecoder):
    """Base for CAN: each chunk is a frame."""

    @abstractmethod
    def decode(self, time: float, direction: Direction, identifier: int, data: bytes) -> TracedPacket:
        """Return the packet of a frame, whose check is that of the controller."""

    def feed(self, chunk: Chunk) -> list[TracedPacket]:
        """Return the packet of this frame."""
        if len(chunk.data) < 2:
            return [TracedPacket(*chunk[:2], "", "?", hex_of(chunk.data), problem="no frame", data=chunk.data)]
        identifier = int.from_bytes(chunk.data[:2], "big")
        return [self.decode(chunk.time, chunk.direction, identifier, chunk.data[2:])]


def hex_of(data: bytes, most: int = _SHOWN_BYTES) -> str:
    """Return bytes as text, ``0A FF ...``."""
    return data[:most].hex(" ").upper() + (" ..." if len(data) > most else "")


def with_unit(name: str, raw: object, si: float | None = None, unit: str = "") -> str:
    """Return a value as text: ``present_voltage 117 (11.7 V)``; without an SI value ``mode 3``."""
    if si is None:
        return f"{name} {raw}"
    return f"{name} {raw} ({f'{si:.4g} {unit}'.rstrip()})"
