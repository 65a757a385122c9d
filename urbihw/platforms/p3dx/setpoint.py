"""Speeds that must arrive on a wire where nothing is acknowledged, and switches that are seen to have arrived; no I/O.

A lost VEL 0 would leave the robot driving, so a set point is repeated: while it is not zero, as often as the watchdog
needs a sign of life; once it is zero, a few times more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from urbihw.platforms.p3dx.commands import encode

AGAIN: Final = 0.2
"""Seconds between repetitions."""
ZEROES: Final = 3
"""How often a zero is sent."""
SWITCH_AGAIN: Final = 0.3
SWITCH_TRIES: Final = 4
SWITCH_SHOWS: Final = 0.03
"""Seconds after which a SIP may show it."""


class SetPoint:
    """One speed: ``name`` is the command that sets it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.value = 0
        self._left = 0
        self._due = 0.0

    def set(self, value: int) -> None:
        """A new set point, to be sent at once if it is another one."""
        if value != self.value:
            self.value, self._due, self._left = value, 0.0, ZEROES

    def halt(self) -> None:
        """Zero, and said so even if it was zero before."""
        self.value, self._due, self._left = 0, 0.0, ZEROES

    def packet(self, now: float) -> bytes | None:
        """What to send now, if anything."""
        if now < self._due or not (self.value or self._left):
            return None
        self._due = now + AGAIN
        self._left = max(0, self._left - 1)
        return encode(self.name, self.value)


@dataclass(slots=True)
class Switch:
    """Something that the flags of a SIP show: send it until they do.

    Attributes:
        reply_id: the request that asked for it.
        packet: what to send.
        mask, wanted: the bits of the flags, and what they shall be.
        tries: how often it may still be sent; sent_at: when it last was.
    """

    reply_id: int
    packet: bytes
    mask: int
    wanted: int
    tries: int = SWITCH_TRIES
    sent_at: float = -math.inf

    def due(self, now: float) -> bool:
        """Whether it is time to send it, or to give up."""
        return now - self.sent_at >= SWITCH_AGAIN

    def send(self, now: float) -> bytes:
        """Count a sending."""
        self.tries -= 1
        self.sent_at = now
        return self.packet

    def shown(self, flags: int, now: float) -> bool:
        """Whether the flags show it; those of a SIP that may have been on its way before it was sent do not count."""
        late_enough = now - self.sent_at >= SWITCH_SHOWS and self.sent_at > -math.inf
        return late_enough and bool(flags & self.mask) == bool(self.wanted)
