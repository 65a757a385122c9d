"""The packets of a Spykee, as the robot sees them: `PK`, type, length of 16 bits big-endian, payload."""

from __future__ import annotations

AUDIO, VIDEO, POWER, LED, MOVE, FILE, PLAY, STOP, VOLUME, LOGIN, LOGIN_REPLY = range(1, 12)
CONFIGURATION, NETWORKS, STREAM, ENGINE, LOG = range(13, 18)
HEADER = 5


class Lost(ValueError):
    """What came is no packet; the robot hangs up."""


def frame(kind: int, payload: bytes = b"") -> bytes:
    """A packet of a kind around its content."""
    return b"PK" + bytes([kind]) + len(payload).to_bytes(2, "big") + payload


def string(text: str) -> bytes:
    """A text with its length in front."""
    data = text.encode("latin-1")
    return bytes([len(data)]) + data


class Cutter:
    """Cuts the stream of the client into packets."""

    def __init__(self) -> None:
        self._rest = b""

    def split(self, data: bytes) -> list[tuple[int, bytes]]:
        """Add bytes; returns the packets that are complete now.  Raises Lost."""
        self._rest += data
        found = []
        while len(self._rest) >= HEADER:
            if self._rest[:2] != b"PK":
                raise Lost(self._rest[:2])
            end = HEADER + int.from_bytes(self._rest[3:5], "big")
            if len(self._rest) < end:
                break
            found.append((self._rest[2], self._rest[HEADER:end]))
            self._rest = self._rest[end:]
        return found
