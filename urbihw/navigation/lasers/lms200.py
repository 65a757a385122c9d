"""Telegrams of a SICK LMS200 (and its kin LMS2xx); bytes only.

    +----+---------+-----------+------------------------------+-----------+
    | 02 | address | length LE | command, data (reply: status) | CRC LE    |
    +----+---------+-----------+------------------------------+-----------+

The host speaks to address 0, the laser answers from 0x80 + its own.  Before a telegram the laser sends a single byte,
0x06 (ACK) or 0x15 (NAK), which a reader may skip.  Sources: ARIA (``ArLMS2xxPacket*.cpp``), Player (``sicklms200.cc``),
the maker's telegram listing 8007954/Q501.
"""

from __future__ import annotations

import struct
from typing import Final

from urbihw.buses.errors import BadFrame
from urbihw.frozen import frozen
from urbihw.navigation.lasers.driver import LaserScan

STX: Final = 2
FROM_LASER: Final = 0x80
ACK: Final = b"\x06"
"""The byte before the answer to a telegram that was understood."""

START: Final = b"\x20\x24"
STOP: Final = b"\x20\x25"
BAUD_CODES: Final = {9600: 0x42, 19200: 0x41, 38400: 0x40, 500000: 0x48}

MODE_REPLY, VARIANT_REPLY, SCAN, REFUSED = 0xA0, 0xBB, 0xB0, 0x92
NO_DISTANCE: Final = 0x1FF7
"""This value and those above it are codes, not distances: no echo, dazzled, overflow, error."""

LONGEST: Final = 812
"""Length of the longest telegram of the listing; a greater one is damaged."""
_CRC_BYTE: Final = 0x8005
_UNITS: Final = {0: 0.01, 1: 0.001, 2: 0.1}


def crc16(data: bytes) -> int:
    """The laser's checksum, which combines each byte with the one before it."""
    register = last = 0
    for byte in data:
        top = register & 0x8000
        register = register << 1 & 0xFFFF
        if top:
            register ^= _CRC_BYTE
        register ^= byte | last << 8
        last = byte
    return register


def telegram(payload: bytes, address: int = 0) -> bytes:
    """Frame a payload as a telegram."""
    data = struct.pack("<BBH", STX, address, len(payload)) + payload
    return data + crc16(data).to_bytes(2, "little")


def baud(speed: int) -> bytes:
    """The payload that changes the baud rate.  Raises KeyError for one that the laser does not support."""
    return bytes((0x20, BAUD_CODES[speed]))


def variant(angle: int, resolution: int) -> bytes:
    """The payload that sets the field of view (100 or 180 degrees) and the resolution (25, 50 or 100 hundredths)."""
    return struct.pack("<BHH", 0x3B, angle, resolution)


@frozen
class SickReply:
    """A telegram of the laser: ``kind`` is its command byte, ``status`` its last byte."""

    kind: int
    data: bytes
    status: int


class SickFramer:
    """Splits a stream into telegrams.

    Attributes:
        damaged: number of telegrams with a wrong length or checksum.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[SickReply]:
        """Process received bytes; returns the telegrams that are complete now."""
        buffer = self._buffer
        buffer += data
        replies: list[SickReply] = []
        while (start := buffer.find(STX)) >= 0:
            del buffer[:start]
            if len(buffer) < 4:
                return replies
            size = buffer[2] | buffer[3] << 8
            if not buffer[1] & FROM_LASER or not 2 <= size <= LONGEST:
                # Most likely not STX but a 2 among other bytes.
                del buffer[:1]
                continue
            end = 4 + size + 2
            if len(buffer) < end:
                return replies
            if crc16(bytes(buffer[: end - 2])) != buffer[end - 2] | buffer[end - 1] << 8:
                self.damaged += 1
                del buffer[:1]
                continue
            replies.append(SickReply(buffer[4], bytes(buffer[5 : end - 3]), buffer[end - 3]))
            del buffer[:end]
        buffer.clear()
        return replies

    def reset(self) -> None:
        """Discard the received bytes."""
        self._buffer.clear()


def parse_scan(reply: SickReply) -> LaserScan:
    """The distances of a telegram of kind SCAN.  Raises BadFrame."""
    if len(reply.data) < 2:
        raise BadFrame("a scan without a count of readings")
    word = reply.data[0] | reply.data[1] << 8
    count, code = word & 0x3FF, word >> 14
    if len(reply.data) != 2 + 2 * count:
        raise BadFrame(f"a scan says {count} readings in {len(reply.data) - 2} bytes")
    if code not in _UNITS:
        raise BadFrame(f"a scan has the unknown unit {code}")
    unit = _UNITS[code]
    raw = struct.unpack_from(f"<{count}H", reply.data, 2)
    # Table look-ups and comprehensions for speed: this runs for every reading of every scan.
    ranges = tuple([(value & 0x1FFF) * unit if value & 0x1FFF < NO_DISTANCE else float("inf") for value in raw])
    return LaserScan(ranges, (NO_DISTANCE - 1) * unit, bool(reply.status & 0x80))
