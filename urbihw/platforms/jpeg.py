"""The size that a JPEG says of itself."""

from __future__ import annotations

from typing import Final

START, END = b"\xff\xd8", b"\xff\xd9"
_FRAME_HEADERS: Final = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
"""Markers behind which the size stands."""


def size_of(jpeg: bytes) -> tuple[int, int] | None:
    """Width and height in pixels; None if it does not say them."""
    at = 2
    while at + 9 <= len(jpeg) and jpeg[at] == 0xFF:
        if jpeg[at + 1] in _FRAME_HEADERS:
            return int.from_bytes(jpeg[at + 7 : at + 9], "big"), int.from_bytes(jpeg[at + 5 : at + 7], "big")
        at += 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
    return None
