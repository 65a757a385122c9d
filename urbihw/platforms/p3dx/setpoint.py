"""Repeated speeds for a wire without acknowledgements, and switches that the robot's flags confirm; no I/O.

A lost VEL 0 would leave the robot driving, so a set point is repeated: while it is not zero, as often as the robot's
watchdog requires; once it is zero, a few more times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from urbihw.platforms.p3dx.commands import encode

REPEAT_PERIOD_S: Final = 0.2
"""Seconds between repetitions."""
ZERO_REPEATS: Final = 3
"""How often a zero is sent."""
SWITCH_PERIOD_S: Final = 0.3
SWITCH_TRIES: Final = 4
SWITCH_DELAY_S: Final = 0.03
"""Seconds after which a SIP may show it."""


class SetPoint:
    """One speed: ``name`` is the command that sets it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.value = 0
        self._left = 0
        self._due = 0.0

    def set_value(self, value: int) -> None:
        """Set the speed, sent at once if it differs from the last one."""
        if value != self.value:
            self.value, self._due, self._left = value, 0.0, ZERO_REPEATS

    def halt(self) -> None:
        """Set the speed to zero, and send it even if it was zero before."""
        self.value, self._due, self._left = 0, 0.0, ZERO_REPEATS

    def next_packet(self, now: float) -> bytes | None:
        """Return the packet to send now, None if none is due."""
        if now < self._due or not (self.value or self._left):
            return None
        self._due = now + REPEAT_PERIOD_S
        self._left = max(0, self._left - 1)
        return encode(self.name, self.value)


@dataclass(slots=True)
class FlagSwitch:
    """A switch whose state the flags of a SIP show: its command is repeated until they do.

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

    def is_due(self, now: float) -> bool:
        """Return whether it is time to send it again, or to give up."""
        return now - self.sent_at >= SWITCH_PERIOD_S

    def next_packet(self, now: float) -> bytes:
        """Return the packet, and count it as sent at `now`."""
        self.tries -= 1
        self.sent_at = now
        return self.packet

    def is_confirmed(self, flags: int, now: float) -> bool:
        """Return whether the flags confirm it; a SIP that may have been sent before the command does not count."""
        late_enough = now - self.sent_at >= SWITCH_DELAY_S and self.sent_at > -math.inf
        return late_enough and bool(flags & self.mask) == bool(self.wanted)
