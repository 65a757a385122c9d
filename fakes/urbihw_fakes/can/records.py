"""Frames as Linux lays them out in memory (`struct can_frame`, linux/can.h): 16 bytes each.

    bytes 0-3 identifier (machine order)   4 length   5-7 nothing   8-15 data
"""

from __future__ import annotations

import struct

from urbihw_fakes.can.node import CanFrame

_RECORD = struct.Struct("=IB3x8s")


class Records:
    """The codec of adapters that pass whole records; incomplete ones are dropped."""

    def __init__(self) -> None:
        self._rest = b""

    def decode(self, data: bytes) -> tuple[list[CanFrame], bytes]:
        """Decode bytes of the host."""
        data = self._rest + data
        whole = len(data) - len(data) % _RECORD.size
        self._rest = data[whole:]
        frames = []
        for identifier, length, content in _RECORD.iter_unpack(data[:whole]):
            if identifier <= 0x7FF and length <= 8:
                frames.append(CanFrame(identifier, content[:length]))
        return frames, b""

    def encode(self, frame: CanFrame) -> bytes:
        """Encode one record for the socket."""
        return _RECORD.pack(frame.id, len(frame.data), frame.data)
