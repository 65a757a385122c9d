"""The cameras on the port AUX1: pan, tilt and zoom, at once (real ones take their time).

To a Sony EVI-D30 a command is `81 01 ... FF`; it answers `90 41 FF` (taken) and `90 51 FF` (done), or `90 60 02 FF` (no
such).  To a Canon VC-C4 it is `FF 30 30 00 ... EF`; it answers `FE 30 30 error 30 EF` with the error 30 (none) or 35
(no such); it does nothing before power (A0 31), control (90 30) and initialization (58 30).
"""

from __future__ import annotations

PAN_TILT = bytes.fromhex("81 01 06 02")
ZOOM = bytes.fromhex("81 01 04 47")
LONGEST = 24


class Camera:
    """Attributes: pan, tilt and zoom in the camera's own counts; ``said``: its answers that were not read yet."""

    def __init__(self) -> None:
        self.pan = self.tilt = self.zoom = 0
        self.said = b""
        self._heard = b""

    def receive_bytes(self, data: bytes) -> None:
        """Receive bytes of the line."""
        self._heard += data
        while b"\xff" in self._heard:
            command, _, self._heard = self._heard.partition(b"\xff")
            self.said += b"\x90\x41\xff\x90\x51\xff" if self._execute_command(command) else b"\x90\x60\x02\xff"
        self._heard = self._heard[-LONGEST:]

    def _execute_command(self, command: bytes) -> bool:
        if command.startswith(PAN_TILT) and len(command) == 14:
            self.pan, self.tilt = _signed(command[6:10]), _signed(command[10:14])
            return True
        if command.startswith(ZOOM) and len(command) == 8:
            self.zoom = _signed(command[4:8])
            return True
        # Address set and "clear" are for everybody on the line.
        return command[:1] == b"\x88"


class CanonCamera:
    """Attributes: pan, tilt and ``tilt_most`` in counts of 0.1125 degrees, zoom in counts, ``said`` as above."""

    HEADER, FOOTER = b"\xff00\x00", b"\xef"
    WAKING = (b"\xa01", b"\x900", b"\x580")

    def __init__(self) -> None:
        self.pan = self.tilt = self.zoom = 0
        self.tilt_most = round(30 / 0.1125)
        self.said = b""
        self._heard = b""
        self._woken = 0

    def receive_bytes(self, data: bytes) -> None:
        """Receive bytes of the line."""
        self._heard += data
        while self.FOOTER in self._heard:
            command, _, self._heard = self._heard.partition(self.FOOTER)
            good = command.startswith(self.HEADER) and self._execute_command(command[len(self.HEADER) :])
            self.said += b"\xfe00" + (b"0" if good else b"5") + b"0\xef"
        self._heard = self._heard[-LONGEST:]

    def _execute_command(self, body: bytes) -> bool:
        if self._woken < len(self.WAKING):
            self._woken += body == self.WAKING[self._woken]
            return body in self.WAKING
        kind, digits = body[:1], body[1:]
        try:
            numbers = [int(digits[at : at + 4], 16) for at in range(len(digits) % 4, len(digits), 4)]
        except ValueError:
            return False
        if kind == b"\x62" and len(numbers) == 2:
            self.pan, self.tilt = numbers[0] - 0x8000, min(numbers[1] - 0x8000, self.tilt_most)
        elif kind == b"\x64" and len(numbers) == 2:
            self.tilt_most = numbers[1] - 0x8000
        elif kind == b"\xb3" and len(numbers) == 1:
            (self.zoom,) = numbers
        else:
            return body == b"\x530"
        return True


def _signed(nibbles: bytes) -> int:
    value = 0
    for nibble in nibbles:
        value = value * 16 + (nibble & 15)
    return value - 65536 if value > 32767 else value
