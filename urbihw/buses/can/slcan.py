"""Decoder of the text of an slcan adapter; no I/O.

    t4018FFF9000FFFFF0009\\r      a frame: identifier (3 digits), length (1), data; what follows is ignored
    \\r, z\\r, \\a                  the adapter's answers to what was sent to it

python-can opens the adapter and sends to it; its own reading takes a system call for every byte, which at the thousand
frames a second of an RMP is a quarter of a core (measured on a pseudo terminal; this here takes 2 % of one).
Source: Lawicel CAN232 manual, version 3.
"""

from __future__ import annotations

from urbihw.buses.can.frame import MOST_DATA, STANDARD_IDS, CanFrame

_LONGEST = 64
"""Longest line in bytes; longer ones do not come from an adapter."""
_ANSWERS = (b"", b"z", b"Z")
_HEAD = 5


class SlcanText:
    """Assembles lines from bytes and decodes them."""

    def __init__(self) -> None:
        self._damaged = 0
        self._rest = b""

    def feed(self, data: bytes) -> list[CanFrame]:
        """Add bytes; return the frames that they complete."""
        *lines, rest = (self._rest + data).replace(b"\a", b"\r").split(b"\r")
        if len(rest) > _LONGEST:
            self._damaged += 1
            rest = b""
        self._rest = rest
        frames = []
        for line in lines:
            frame = _frame(line)
            if frame is not None:
                frames.append(frame)
            elif line not in _ANSWERS and line[:1] not in b"TrRV":
                self._damaged += 1
        return frames

    def pop_damaged_count(self) -> int:
        """Return how many lines were neither a frame nor an answer, since the last call."""
        damaged, self._damaged = self._damaged, 0
        return damaged


def _frame(line: bytes) -> CanFrame | None:
    """Decode a line; None if it is not a frame."""
    if line[:1] != b"t":
        return None
    try:
        identifier, length = int(line[1:4], 16), int(line[4:_HEAD])
        data = bytes.fromhex(line[_HEAD : _HEAD + 2 * length].decode("ascii"))
    except ValueError:
        return None
    if not 0 <= identifier < STANDARD_IDS or not 0 <= length <= MOST_DATA or len(data) != length:
        return None
    return CanFrame(identifier, data)
