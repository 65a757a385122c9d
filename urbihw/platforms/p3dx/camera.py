"""The pan, tilt and zoom of a camera on the controller's port AUX1, as bytes; no I/O.

The cameras are spoken to without being heard, as ARIA can do it: what is read is what was last ordered.

    Sony EVI-D30    VISCA; source: ARIA (``ArSonyPTZ.cpp``)
    Canon VC-C4     FF 30 30 00 command [digits in ASCII] EF, at most one every 0.3 s; source: ARIA (``ArVCC4.h``, its
                    text about units and answers).  UNCONFIRMED: the greatest zoom, and the sign of pan
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Protocol


class Mechanics(Protocol):
    """What a camera can do: each method returns the packets to send, in order.

    Attributes:
        pan: greatest angle to either side, rad; tilt: least and greatest angle, rad, up is positive.
        gap: seconds to leave between two packets.
    """

    pan: float
    tilt: tuple[float, float]
    gap: float

    def connect(self) -> Sequence[bytes]:
        """The packets that make the mechanics ready."""
        ...

    def look(self, pan: float, tilt: float) -> Sequence[bytes]:
        """Look there: rad to the left and up from straight ahead."""
        ...

    def zoom(self, value: float) -> Sequence[bytes]:
        """Zoom: 0 wide, 1 tele."""
        ...


class SonyEviD30:
    """VISCA to camera 1; it counts pan to the right."""

    pan = math.radians(90)
    tilt = (-math.radians(30), math.radians(30))
    gap = 0.0

    PAN_COUNTS: Final = 0x370
    TILT_COUNTS: Final = 0x12C
    """Counts at the greatest angles."""
    SPEEDS: Final = bytes((0x18, 0x14))
    MOST_ZOOM: Final = 1023

    def connect(self) -> Sequence[bytes]:
        """Clear the line, then give the cameras on it their addresses."""
        return (bytes.fromhex("88 01 00 01 FF 88 30 01 FF"),)

    def look(self, pan: float, tilt: float) -> Sequence[bytes]:
        counts = round(-pan / self.pan * self.PAN_COUNTS), round(tilt / self.tilt[1] * self.TILT_COUNTS)
        return (b"\x81\x01\x06\x02" + self.SPEEDS + _nibbles(counts[0]) + _nibbles(counts[1]) + b"\xff",)

    def zoom(self, value: float) -> Sequence[bytes]:
        return (b"\x81\x01\x04\x47" + _nibbles(round(value * self.MOST_ZOOM)) + b"\xff",)


class CanonVcC4:
    """Canon's protocol to device 0."""

    pan = math.radians(98)
    tilt = (-math.radians(30), math.radians(88))
    gap = 0.3

    UNIT: Final = math.radians(0.1125)
    """rad per count of pan and tilt."""
    MIDDLE: Final = 0x8000
    MOST_ZOOM: Final = 1960

    def connect(self) -> Sequence[bytes]:
        """Power on, take control, find the middle, allow the whole range of tilt (the factory allows 30 degrees)."""
        tilts = "".join(self._digits(angle) for angle in self.tilt)
        return tuple(_canon(body) for body in (b"\xa01", b"\x900", b"\x580", b"\x641" + tilts.encode("ascii")))

    def look(self, pan: float, tilt: float) -> Sequence[bytes]:
        """Halt, then look there: a camera that is still moving refuses the next order."""
        return _canon(b"\x530"), _canon(b"\x62" + (self._digits(-pan) + self._digits(tilt)).encode("ascii"))

    def zoom(self, value: float) -> Sequence[bytes]:
        return (_canon(b"\xb3" + b"%04X" % round(value * self.MOST_ZOOM)),)

    def _digits(self, angle: float) -> str:
        return f"{self.MIDDLE + round(angle / self.UNIT):04X}"


CAMERAS: Final[dict[str, type[Mechanics]]] = {"evi-d30": SonyEviD30, "vc-c4": CanonVcC4}
"""Name in the settings -> what it can do."""


def _canon(body: bytes) -> bytes:
    return b"\xff00\x00" + body + b"\xef"


def _nibbles(value: int) -> bytes:
    """Four bytes of four bits each."""
    return bytes((value >> shift & 15) for shift in (12, 8, 4, 0))
