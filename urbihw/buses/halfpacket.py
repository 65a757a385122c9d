"""A time limit for packets of which only the beginning has come: what follows would be taken for their rest.

Links whose driver gives up when it has heard nothing (NXT, Nao, lasers) or ends each question by a time-out (servos)
need none, nor those whose packets are as short as those of a Segway, of which at most one is lost.
"""

from __future__ import annotations

HALF_PACKET_TIMEOUT_S = 1.0
"""Seconds in which a packet that has begun must be complete; the longest, a picture of a Spykee, takes some 0.1 s."""


class HalfPacket:
    """The packet whose beginning a framer holds.

    Attributes:
        dropped: number of those that were never complete.
    """

    def __init__(self, timeout: float = HALF_PACKET_TIMEOUT_S) -> None:
        self.dropped = 0
        self._timeout = timeout
        self._since: float | None = None

    def is_overdue(self, complete: int, held: int, now: float) -> bool:
        """Return whether the framer must drop what it holds; call it after each reading, also without bytes.

        ``complete`` is the number of packets that the reading has completed, ``held`` that of the bytes that are left.
        """
        if not held:
            self._since = None
        elif complete or self._since is None:
            self._since = now
        elif now - self._since > self._timeout:
            self._since = None
            self.dropped += 1
            return True
        return False
