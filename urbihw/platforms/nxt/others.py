"""The devices in the brick itself: Battery, Beeper, Command (manual, chapter 24)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import Origin, UObject, event, function, reading
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt import words
from urbihw.platforms.nxt.motion import HIGHEST_HZ, LOWEST_HZ
from urbihw.platforms.nxt.ports import Gauge, brick_of
from urbihw.platforms.nxt.reading import BRICK
from urbihw.platforms.nxt.sensors import octets

BATTERY_PACE: Final = 1.0
FOREVER_S: Final = 1e9
"""Seconds beyond which a tone counts as endless."""


class NxtBattery(Gauge):
    """The charge of the battery, 0..1: ``val``, and ``remain`` as in chapter 22; ``voltage`` in V.

    0 and 1 are the voltages of the options ``battery_empty`` and ``battery_full``.
    """

    uname = "Battery"
    slot_words = words.BATTERY

    val = reading(math.nan)
    remain = reading(math.nan)
    voltage = reading(math.nan)
    # The brick does not measure capacity and current.
    capacity = reading(math.nan)
    current = reading(math.nan)

    def init(self) -> None:
        """``Battery.new``"""
        self.brick = brick_of(self)
        self.brick.gauges.append(self)
        if self.brick.measured is not None:
            self.read(*self.brick.measured)

    def read(self, values: Mapping[str, Any], stamp: float) -> None:
        """Show the voltage and the estimated charge of the battery."""
        empty, full = self.brick.volts
        volts = values["millivolts"] / 1000
        level = min(1.0, max(0.0, (volts - empty) / (full - empty)))
        self.voltage.sense(volts, stamp)
        self.val.sense(level, stamp)
        self.remain.sense(level, stamp)


class Beeper(UObject):
    """The speaker of the brick, for tones."""

    def init(self) -> None:
        """``Beeper.new``"""
        self.brick = brick_of(self)

    @function
    def play(self, frequency: float, duration: float) -> None:
        """Play a tone of 200..14000 Hz for some seconds, endless with 0; returns at once (manual, chapter 24, Beeper).

        Another place of that chapter says milliseconds; all examples and the class's own description are in seconds.
        """
        if not LOWEST_HZ <= frequency <= HIGHEST_HZ:
            raise ValueError(f"a beep has {LOWEST_HZ} to {HIGHEST_HZ} Hz, not {frequency:g}")
        if duration > FOREVER_S:
            duration = 0.0
        if not duration >= 0:
            raise ValueError(f"a beep lasts some seconds, or 0 for ever, not {duration:g} s")
        # A duration below 1 ms must not become 0, which is endless.
        milliseconds = max(1, round(duration * 1000)) if duration else 0
        self.brick.channel.set_target(BRICK, "tone", (round(frequency), milliseconds))

    @function
    def stop(self) -> None:
        """Stop the tone that plays."""
        self.brick.channel.set_target(BRICK, "silence", True)


class NxtCommand(UObject):
    """Commands of the brick as bytes, from the opcode on; for experts.

    ``request(bytes, size)`` is in nxt.u.  Commands from 0x80 on are system commands; the one that erases the firmware
    is refused.
    """

    slot_words = words.COMMAND

    answered = event()

    def init(self) -> None:
        """Made by the robot, as ``Command``."""
        self.brick = brick_of(self)
        self.count = 0

    @function("send")
    def send_silently(self, buffer: list[Any]) -> None:
        """Send a command that requests no answer."""
        body = _checked(buffer)
        self.brick.channel.write(BRICK, "silent", body, self._done, self._origin(body))

    @function
    def ask(self, buffer: list[Any]) -> int:
        """Send a command that requests an answer; ``answered`` gets this number and the answer, a list or []."""
        body = _checked(buffer)
        origin = self._origin(body)
        self.count += 1
        number = self.count

        def answered(reply: Reply) -> None:
            self._done(reply)
            self.answered.emit(number, list(map(float, reply.value)) if reply.ok else [])

        self.brick.channel.write(BRICK, "telegram", body, answered, origin)
        return number

    def _origin(self, body: bytes) -> Origin | None:
        """Return the origin of a command that moves something or sounds; it gets the lease.  Raises as ``admit``."""
        origin = self.brick.motion.admit(BRICK) if body[:1] in p.MOVING_OPCODES else None
        for port in sorted(p.outputs_of(b"\x00" + body)):
            origin = self.brick.motion.admit(port)
            if (device := self.brick.ports.get(port)) is not None:
                self.brick.end_path(device)
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
