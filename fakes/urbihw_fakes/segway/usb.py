"""The maker's USB link: each frame in a packet of 18 bytes, in both directions.

    host to base   F0 55 00 00 00 00 ID ID 00 | data (8) | sum          ID: identifier, big-endian
    base to host   F0 55 AA 00 II JJ 00 00 00 | data (8) | sum          identifier = II << 3 | JJ >> 5; BB for channel B

The sum makes the end-around-carry sum of all 18 bytes 0. A real base sends both channels, each frame twice.
"""

from __future__ import annotations

from urbihw_fakes.can.node import CanFrame

SIZE = 18
_HEAD = b"\xf0\x55"


class UsbLink:
    """The codec. `both`: also send channel B. `damaged` counts bytes of the host outside packets."""

    def __init__(self, *, both: bool = True) -> None:
        self.both = both
        self.damaged = 0
        self._rest = b""

    def decode(self, data: bytes) -> tuple[list[CanFrame], bytes]:
        """Decode bytes of the host."""
        data = self._rest + data
        frames = []
        while len(data) >= SIZE:
            packet = data[:SIZE]
            if packet[:2] != _HEAD or packet[17] != checksum(packet[:17]):
                data = data[1:]
                self.damaged += 1
                continue
            data = data[SIZE:]
            frames.append(CanFrame(int.from_bytes(packet[6:8], "big"), packet[9:17]))
        self._rest = data
        return frames, b""

    def encode(self, frame: CanFrame) -> bytes:
        """Encode a frame for the host, for one channel or both."""
        channels = (0xAA, 0xBB) if self.both else (0xAA,)
        return b"".join(packet(frame, channel) for channel in channels)


def packet(frame: CanFrame, channel: int = 0xAA) -> bytes:
    """Return the packet of a frame of the base."""
    place = bytes([frame.id >> 3, frame.id << 5 & 0xFF])
    body = _HEAD + bytes([channel, 0]) + place + bytes(3) + frame.data.ljust(8, b"\0")
    return body + bytes([checksum(body)])


def checksum(body: bytes) -> int:
    """Return the checksum byte of 17 bytes."""
    total = sum(body)
    for _ in range(2):
        total = (total & 0xFF) + (total >> 8)
    return -total & 0xFF
