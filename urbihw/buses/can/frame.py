"""A classic CAN frame with an identifier of 11 bits: all that the robots here use."""

from __future__ import annotations

from typing import NamedTuple

MOST_DATA = 8
"""Data bytes of a frame at most."""
STANDARD_IDS = 0x800
"""Number of identifiers of 11 bits."""
_BITS_AROUND = 47  # start, identifier, control, check sum, end and pause, without stuff bits


class CanFrame(NamedTuple):
    """A frame: `id` 0..0x7FF, at most 8 bytes of `data`."""

    id: int
    data: bytes

    def __str__(self) -> str:
        return f"{self.id:03X}#{self.data.hex().upper()}"

    @property
    def wire_bytes(self) -> int:
        """About how many times 8 bits it takes on the bus, without stuff bits."""
        return _BITS_AROUND // 8 + 1 + len(self.data)
