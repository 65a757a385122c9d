"""The pan, tilt and zoom of a Sony EVI-D30 on the controller's port AUX1: VISCA; bytes only.

The camera is spoken to without being heard, as ARIA does (``ArSonyPTZ.cpp``); what is read is what was last ordered.
"""

from __future__ import annotations

import math
from typing import Final

PAN_MOST: Final = math.radians(90)
TILT_MOST: Final = math.radians(30)
ZOOM_MOST: Final = 1023
_PAN_COUNTS, _TILT_COUNTS = 0x370, 0x12C
_PAN_SPEED, _TILT_SPEED = 0x18, 0x14

INIT: Final = bytes.fromhex("88 01 00 01 FF 88 30 01 FF")
"""Clear the line, then give the cameras on it their addresses."""


def pan_tilt(pan: float, tilt: float) -> bytes:
    """Look there: rad to the left and up from straight ahead (the camera counts pan to the right)."""
    counts = round(-pan / PAN_MOST * _PAN_COUNTS), round(tilt / TILT_MOST * _TILT_COUNTS)
    return b"\x81\x01\x06\x02" + bytes((_PAN_SPEED, _TILT_SPEED)) + _nibbles(counts[0]) + _nibbles(counts[1]) + b"\xff"


def zoom(value: float) -> bytes:
    """Zoom: 0 wide, 1 tele."""
    return b"\x81\x01\x04\x47" + _nibbles(round(value * ZOOM_MOST)) + b"\xff"


def _nibbles(value: int) -> bytes:
    """Four bytes of four bits each."""
    return bytes((value >> shift & 15) for shift in (12, 8, 4, 0))
