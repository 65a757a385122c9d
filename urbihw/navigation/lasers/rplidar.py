"""Packets of a Slamtec RPLIDAR (A1, A2, A3); bytes only.

    request             A5 command [length data check sum]          check sum: all bytes before it, exclusive or
    response descriptor A5 5A length and mode (30 + 2 bits LE) type
    one measurement     quality * 4 | not S * 2 | S    angle low 7 bits * 2 | 1    angle high    distance (u16 LE)

S marks the first measurement of a turn.  Angles are in 1/64 degree, clockwise from the front; distances in 1/4 mm, 0 is
no echo.  Source: Slamtec, "Interface Protocol and Application Notes, applied to RPLIDAR A1 & A2", rev. 1.1 (2018).
"""

from __future__ import annotations

import math
from functools import reduce
from operator import xor
from typing import Final, NamedTuple

START_FLAG: Final = 0xA5
STOP, RESET, SCAN, GET_INFO, GET_HEALTH, SET_MOTOR_PWM = 0x25, 0x40, 0x20, 0x50, 0x52, 0xF0
INFO_TYPE, HEALTH_TYPE, SCAN_TYPE = 0x04, 0x06, 0x81
_DESCRIPTOR: Final = bytes((0xA5, 0x5A))
_DESCRIPTOR_SIZE, _NODE_SIZE = 7, 5
LENGTHS: Final = {INFO_TYPE: 20, HEALTH_TYPE: 3, SCAN_TYPE: _NODE_SIZE}
"""Type of a response -> length of its data."""
BINS: Final = 360
"""Readings of a scan: one per degree, the first one from -180 to -179 degrees."""
MOST_NODES: Final = 20000
"""More measurements without the mark of a new turn are no turn."""
HEALTH_ERROR: Final = 2


def request(command: int, data: bytes = b"") -> bytes:
    """A request, with data or without."""
    packet = bytes((START_FLAG, command))
    if data:
        packet += bytes((len(data),)) + data
        packet += bytes((reduce(xor, packet),))
    return packet


class Response(NamedTuple):
    """The data of a response with one of LENGTHS."""

    kind: int
    data: bytes


class ResponseReader:
    """Finds the response of one type in a stream, whatever comes before it."""

    def __init__(self, kind: int) -> None:
        self._kind = kind
        self._buffer = b""

    def feed(self, data: bytes) -> Response | None:
        """Process received bytes; returns the response once it is complete.  That of SCAN has no data of its own.

        Bytes behind the response remain in ``rest``.
        """
        self._buffer += data
        while (start := self._buffer.find(_DESCRIPTOR)) >= 0:
            self._buffer = self._buffer[start:]
            if len(self._buffer) < _DESCRIPTOR_SIZE:
                return None
            kind, length = self._buffer[6], int.from_bytes(self._buffer[2:6], "little") & 0x3FFFFFFF
            if kind != self._kind or length != LENGTHS[kind]:
                self._buffer = self._buffer[1:]
                continue
            end = _DESCRIPTOR_SIZE + (0 if kind == SCAN_TYPE else length)
            if len(self._buffer) < end:
                return None
            return Response(kind, self._buffer[_DESCRIPTOR_SIZE:end])
        self._buffer = self._buffer[-1:]
        return None

    @property
    def rest(self) -> bytes:
        """The bytes of measurements behind the descriptor of SCAN."""
        return self._buffer[_DESCRIPTOR_SIZE:]


class TurnReader:
    """Assembles whole turns out of measurements.

    Attributes:
        damaged: number of bytes that belong to no measurement.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._buffer = bytearray()
        self._ranges: list[float] | None = None
        self._count = 0

    def feed(self, data: bytes) -> tuple[int, list[float] | None]:
        """Process received bytes; returns the number of measurements and the last complete turn.

        A turn is BINS distances in m from right to left, inf without an echo; of several in one bin the nearest counts.
        """
        buffer = self._buffer
        buffer += data
        nodes, at, turn = 0, 0, None
        while len(buffer) - at >= _NODE_SIZE:
            first, angle = buffer[at], buffer[at + 1]
            if (first & 1) == (first >> 1 & 1) or not angle & 1:
                self.damaged += 1
                at += 1
                continue
            if first & 1:
                turn, self._ranges, self._count = self._ranges or turn, [math.inf] * BINS, 0
            self._add(angle >> 1 | buffer[at + 2] << 7, buffer[at + 3] | buffer[at + 4] << 8)
            nodes += 1
            at += _NODE_SIZE
        del buffer[:at]
        return nodes, turn

    def _add(self, angle: int, distance: int) -> None:
        self._count += 1
        if self._ranges is None:
            return
        if self._count > MOST_NODES or angle >= 360 * 64:
            # No laser turns like this; the next mark begins anew.
            self._ranges = None
            return
        if distance:
            index = math.floor(180 - angle / 64) % BINS
            self._ranges[index] = min(self._ranges[index], distance / 4000)
