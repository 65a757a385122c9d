"""What is in the brick itself: Battery, Beeper, Command (manual, chapter 24)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import Origin, UObject, event, function, reading
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt.motion import HIGHEST_HZ, LONGEST_TONE, LOWEST_HZ
from urbihw.platforms.nxt.ports import Gauge, brick_of
from urbihw.platforms.nxt.reading import BRICK
from urbihw.platforms.nxt.sensors import octets

BATTERY_PACE: Final = 1.0


class Battery(Gauge):
    """What is left in the battery, 0..1: ``val``, and ``remain`` as in chapter 22; ``voltage`` in V.

    0 and 1 are the voltages of the options ``battery_empty`` and ``battery_full``.
    """

    val = reading(math.nan)
    remain = reading(math.nan)
    voltage = reading(math.nan)
    # The brick measures neither.
    capacity = reading(math.nan)
    current = reading(math.nan)

    def init(self) -> None:
        """``Battery.new``"""
        self.brick = brick_of(self)
        self.brick.gauges.append(self)
        self.brick.wire.watch(BRICK, ("millivolts",), BATTERY_PACE)

    def read(self, values: Mapping[str, Any], stamp: float) -> None:
        """See ``Gauge``."""
        empty, full = self.brick.volts
        volts = values["millivolts"] / 1000
        level = min(1.0, max(0.0, (volts - empty) / (full - empty)))
        self.voltage.sense(volts, stamp)
        self.val.sense(level, stamp)
        self.remain.sense(level, stamp)


class Beeper(UObject):
    """The speaker."""

    def init(self) -> None:
        """``Beeper.new``"""
        self.brick = brick_of(self)

    @function
    def play(self, frequency: float, duration: float) -> None:
        """Beep with 200..14000 Hz for some seconds, 0 for ever; returns at once."""
        if not LOWEST_HZ <= frequency <= HIGHEST_HZ:
            raise ValueError(f"a beep has {LOWEST_HZ} to {HIGHEST_HZ} Hz, not {frequency:g}")
        longest = LONGEST_TONE / 1000
        if math.isinf(duration):
            duration = 0.0
        if not 0 <= duration <= longest:
            raise ValueError(f"a beep lasts up to {longest:g} s, or 0 for ever, not {duration:g} s")
        # Less than a millisecond is not for ever.
        milliseconds = max(1, round(duration * 1000)) if duration else 0
        self.brick.wire.aim(BRICK, "tone", (round(frequency), milliseconds))

    @function
    def stop(self) -> None:
        """Silence."""
        self.brick.wire.aim(BRICK, "silence", True)


class Command(UObject):
    """Commands of the brick as bytes, from the opcode on; for experts.

    ``request(bytes, size)`` is in nxt.u.  Commands from 0x80 on are system commands; the one that erases the firmware
    is refused.
    """

    uname = "NxtCommand"

    answered = event()

    def init(self) -> None:
        """Made by the robot, as ``Command``."""
        self.brick = brick_of(self)
        self.count = 0

    @function("send")
    def send_silently(self, buffer: list[Any]) -> None:
        """Send a command that wants no answer."""
        body = _checked(buffer)
        self.brick.wire.write(BRICK, "silent", body, self._done, self._origin(body))

    @function
    def ask(self, buffer: list[Any]) -> int:
        """Send a command that wants an answer; ``answered`` then has this number and the answer as a list, or []."""
        body = _checked(buffer)
        origin = self._origin(body)
        self.count += 1
        number = self.count

        def answered(reply: Reply) -> None:
            self._done(reply)
            self.answered.emit(number, list(map(float, reply.value)) if reply.ok else [])

        self.brick.wire.write(BRICK, "telegram", body, answered, origin)
        return number

    def _origin(self, body: bytes) -> Origin | None:
        """Where a command comes from that sets motors in motion; it holds the lease on them.  Raises as ``admit``."""
        origin = None
        for port in sorted(p.outputs_of(b"\x00" + body)):
            origin = self.brick.motion.admit(port)
        return origin

    def _done(self, reply: Reply) -> None:
        if not reply.ok:
            self.brick.log.warning("Command: not sent: %s", reply.error)


def _checked(buffer: list[Any]) -> bytes:
    body = octets(buffer)
    try:
        p.raw(body, reply=True)
    except BadValue as error:
        raise ValueError(str(error)) from error
    return body
