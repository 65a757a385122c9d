"""Packets of the USB link of an RMP: 18 bytes each way. Bytes only.

    host to base   F0 55 00 00 00 00 ID ID 00 | data (8) | sum          ID: CAN identifier, big-endian
    base to host   F0 55 AA 00 II JJ 00 00 00 | data (8) | sum          identifier = II << 3 | JJ >> 5

Byte 2 of a received packet is the channel: AA is used, BB repeats it and is ignored. The sum is the two's complement
of the end-around-carry sum of the 17 bytes before it. FTDI chip, 0403:e729, 460800 baud (libsegwayrmp, Player, Orca).
"""

from __future__ import annotations

from typing import Final

from urbihw.buses.can.frame import STANDARD_IDS, CanFrame

BAUD: Final = 460_800
SIZE: Final = 18
_HEAD = b"\xf0\x55"
_CHANNEL_A = 0xAA
_KEPT = 16 * SIZE
"""Maximum bytes of garbage that are scanned again with the next data."""


def packet(frame: CanFrame) -> bytes:
    """Return the packet of a frame of the host."""
    body = _HEAD + bytes(4) + frame.id.to_bytes(2, "big") + b"\0" + frame.data.ljust(8, b"\0")
    return body + bytes([_sum(body)])


def is_intact(data: bytes) -> bool:
    """Return whether the sum of a packet is right."""
    return len(data) == SIZE and _sum(data[:-1]) == data[-1]


class UsbReader:
    """Finds packets in received bytes.

    Attributes:
        damaged: number of runs of bytes that were no packet; a long run counts as one for each 18 bytes begun.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._rest = b""
        self._lost = False
        self._skipped = 0

    def feed(self, data: bytes) -> list[CanFrame]:
        """Return the frames of channel A that these bytes complete."""
        data = self._rest + data
        frames: list[CanFrame] = []
        start, end = 0, len(data)
        while end - start >= SIZE:
            if data[start] == _HEAD[0] and _sum(data[start : start + SIZE - 1]) == data[start + SIZE - 1]:
                self._lost = False
                self._parse_packet(data[start : start + SIZE], frames)
                start += SIZE
                continue
            if not self._lost:
                self._lost = True
                self.damaged += 1
                self._skipped = 0
            found = data.find(_HEAD[:1], start + 1)
            found = end if found < 0 else found
            self._skipped += found - start
            self.damaged += max(0, self._skipped - 1) // SIZE
            self._skipped = (self._skipped - 1) % SIZE + 1
            start = found
        self._rest = data[start:][-_KEPT:]
        return frames

    def _parse_packet(self, packet: bytes, frames: list[CanFrame]) -> None:
        # Byte 1 is 0 in the heartbeat of older firmware.
        if packet[1] == _HEAD[1] and packet[2] == _CHANNEL_A:
            frames.append(CanFrame((packet[4] << 3 | packet[5] >> 5) % STANDARD_IDS, packet[9:17]))


def _sum(body: bytes) -> int:
    total = sum(body)
    total = (total & 0xFF) + (total >> 8)
    return -((total & 0xFF) + (total >> 8)) & 0xFF
