"""What a lobby says: ``[00001234:channel] text`` lines, gathered per scheduler round, bounded.

The server takes the bytes of a round by ``take()`` when told by ``wanted``; bytes it cannot deliver count against the
limit, and beyond it the connection is given up (server protocol, section 7: the original buffered without limit).
"""

from __future__ import annotations

from collections.abc import Callable


def stamp(now: float) -> str:
    """The time stamp of a round: milliseconds, at least eight digits."""
    return f"{int(now * 1000 + 1e-6):08d}"


class Output:
    """The outgoing side of a lobby.

    ``now`` gives the time of the round; ``wanted`` is called once when there is something to take; ``limit`` is the
    number of bytes that may wait to be read by the other side.
    """

    def __init__(self, now: Callable[[], float], wanted: Callable[[], None], limit: int = 8 * 1024 * 1024) -> None:
        self._now = now
        self._wanted = wanted
        self._parts: list[bytes] = []
        self.limit = limit
        self.sent = 0
        self.open = True

    def write(self, data: bytes) -> None:
        """Send bytes as they are; silently nothing when closed."""
        if not self.open or not data:
            return
        if not self._parts:
            self._wanted()
        self._parts.append(data)
        self.sent += len(data)

    def line(self, text: str, channel: str = "") -> None:
        """Send one line with the time stamp; ``text`` has one character per byte and may contain line ends."""
        tag = f":{channel}" if channel else ""
        self.write(f"[{stamp(self._now())}{tag}] {text}\n".encode("latin-1", "replace"))

    def take(self) -> bytes:
        """All that was written since the last call."""
        data = b"".join(self._parts)
        self._parts.clear()
        return data

    def close(self) -> None:
        """Nothing more can be said."""
        self.open = False
        self._parts.clear()
