"""A Sony EVI-D30 on the port AUX1: pan, tilt and zoom by VISCA, at once (a real one takes its time).

A command is `81 01 ... FF`; the camera answers `90 41 FF` (taken) and `90 51 FF` (done), or `90 60 02 FF` (no such).
"""

from __future__ import annotations

PAN_TILT = bytes.fromhex("81 01 06 02")
ZOOM = bytes.fromhex("81 01 04 47")
LONGEST = 16


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


def _signed(nibbles: bytes) -> int:
    value = 0
    for nibble in nibbles:
        value = value * 16 + (nibble & 15)
    return value - 65536 if value > 32767 else value
