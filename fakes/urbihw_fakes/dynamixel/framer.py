"""Bytes of the host -> requests, of both protocols on one wire.

Real units each search for their own header. One reader suffices for all, because the two headers differ:
`FF FF FD 00` is a protocol 2.0 header, and in protocol 1.0 it would be a packet of length 0, which does not exist.
"""

from __future__ import annotations

from dataclasses import dataclass

from urbihw_fakes.dynamixel import packet1, packet2

BROADCAST = 0xFE


@dataclass(frozen=True, slots=True)
class Request:
    """One instruction packet; `intact` says whether its checksum or CRC was right."""

    protocol: int
    unit: int
    code: int
    params: bytes
    intact: bool


class Framer:
    """Collects bytes to packets; drops an incomplete packet after the maximum pause of the protocol."""

    def __init__(self) -> None:
        self._buffer = b""
        self._last = 0.0

    def feed(self, data: bytes, began: float, ended: float) -> list[Request]:
        """Process bytes that arrived from `began` to `ended` (seconds); return the complete requests."""
        if self._buffer:
            allowed = packet2.MAX_PAUSE if self._buffer[2:3] == b"\xfd" else packet1.MAX_PAUSE
            # Times are sums of floats; a rounding error must not lengthen a pause.
            if began - self._last > allowed + 1e-9:
                self._buffer = b""
        self._last = ended
        buffer = self._buffer + data if self._buffer else data
        requests: list[Request] = []
        start = 0
        while True:
            start = buffer.find(b"\xff\xff", start)
            if start < 0:
                self._buffer = b"\xff" if buffer.endswith(b"\xff") else b""
                return requests
            size, request = _cut(buffer, start)
            if size == 0:
                self._buffer = buffer[start:]
                return requests
            if request is not None:
                requests.append(request)
            start += size


def _cut(buffer: bytes, start: int) -> tuple[int, Request | None]:
    """One packet at `start`: (bytes to go on by, the request); 0 bytes when more must come first."""
    if len(buffer) < start + 4:
        return 0, None
    unit = buffer[start + 2]
    length = buffer[start + 3]
    if unit == 0xFD and length == 0:
        return _cut2(buffer, start)
    if unit == 0xFF or length < 2:
        return 1, None
    end = start + 4 + length
    if len(buffer) < end:
        return 0, None
    body = buffer[start + 2 : end - 1]
    intact = packet1.checksum(body) == buffer[end - 1]
    return 4 + length, Request(1, unit, body[2], body[3:], intact)


def _cut2(buffer: bytes, start: int) -> tuple[int, Request | None]:
    if len(buffer) < start + 7:
        return 0, None
    length = buffer[start + 5] | buffer[start + 6] << 8
    if length < 3:
        return 1, None
    end = start + 7 + length
    if len(buffer) < end:
        return 0, None
    raw = buffer[start : end - 2]
    intact = packet2.crc(raw) == buffer[end - 2] | buffer[end - 1] << 8
    # The answers of other units are on the same bus; a status packet is not an instruction.
    if raw[7] == packet2.STATUS:
        return 7 + length, None
    body = packet2.unstuff(raw[7:])
    return 7 + length, Request(2, raw[4], body[0], body[1:], intact)
