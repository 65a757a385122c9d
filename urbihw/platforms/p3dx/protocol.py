"""ARCOS on the wire: packets to and from a Pioneer's controller; bytes only.

    +----+----+-------+-------------------------+----------------+
    | FA | FB | count | body (count - 2 bytes)  | checksum hi lo |
    +----+----+-------+-------------------------+----------------+

The body is a command number with its argument, or a packet type with its data; numbers in it are little-endian, the
checksum is not.  Sources: the ARCOS chapter of the Pioneer 3 manual; ARIA (``ArRobotPacket.cpp``,
``ArRobotPacketReceiver.cpp``); Player's p2os driver.
"""

from __future__ import annotations

from typing import Final

from urbihw.buses.errors import BadValue

HEADER: Final = b"\xfa\xfb"
POSITIVE: Final = 0x3B
NEGATIVE: Final = 0x1B
TEXT: Final = 0x2B
LONGEST_TEXT: Final = 199
"""A packet has at most 200 bytes behind its count in P2OS and in ARIA."""
LARGEST: Final = 32767

_SHORTEST: Final = 3
_FRAME: Final = 3


def checksum(body: bytes) -> int:
    """Sum of the body's big-endian words modulo 65536; a byte left over is XORed into the low byte."""
    even = len(body) & ~1
    total = sum(body[0:even:2]) << 8
    total += sum(body[1:even:2])
    if len(body) & 1:
        total ^= body[-1]
    return total & 0xFFFF


def packet(body: bytes) -> bytes:
    """Return the packet of a body."""
    return HEADER + bytes((len(body) + 2,)) + body + checksum(body).to_bytes(2, "big")


def command(number: int, argument: int | bytes | None = None) -> bytes:
    """Return a command packet: no argument, an integer (-32767..65535, the sign is sent apart), or a byte string.

    Raises BadValue for an argument out of range.
    """
    head = bytes((number,))
    if argument is None:
        return packet(head)
    if isinstance(argument, bytes):
        if len(argument) > LONGEST_TEXT:
            raise BadValue(f"command {number}: {len(argument)} bytes are too long; at most {LONGEST_TEXT} fit")
        return packet(head + bytes((TEXT, len(argument))) + argument)
    if not -LARGEST <= argument <= 0xFFFF:
        raise BadValue(f"command {number}: {argument} does not fit; it must be from {-LARGEST} to 65535")
    kind = NEGATIVE if argument < 0 else POSITIVE
    return packet(head + bytes((kind,)) + abs(argument).to_bytes(2, "little"))


class ArcosFramer:
    """Splits a stream into the bodies of its valid packets; other bytes are skipped one by one.

    Attributes:
        damaged: number of packets with a wrong length or checksum.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._buffer = bytearray()

    @property
    def held(self) -> int:
        """The number of bytes of a packet that is not complete."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[bytes]:
        """Process received bytes; return the bodies that are complete."""
        buffer = self._buffer
        buffer += data
        bodies: list[bytes] = []
        while (start := buffer.find(HEADER)) >= 0:
            if start:
                # An FA before FA FB is skipped here, too: `FA FA FB` still finds its packet.
                del buffer[:start]
            if len(buffer) < _FRAME:
                return bodies
            count = buffer[2]
            if count < _SHORTEST:
                self._skip()
                continue
            end = count + _FRAME
            if len(buffer) < end:
                return bodies
            body = bytes(buffer[_FRAME : end - 2])
            if checksum(body) != buffer[end - 2] << 8 | buffer[end - 1]:
                self._skip()
                continue
            bodies.append(body)
            del buffer[:end]
        # No packet can begin in the rest, except with its last byte.
        del buffer[: len(buffer) - buffer.endswith(HEADER[:1])]
        return bodies

    def reset(self) -> None:
        """Drop all buffered bytes, as after a new connection, and when a packet is not complete in time."""
        self._buffer.clear()

    def _skip(self) -> None:
        """Continue behind the header of a damaged packet, which may contain the beginning of a valid one."""
        self.damaged += 1
        del self._buffer[: len(HEADER)]
