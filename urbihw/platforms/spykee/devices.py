"""Tracks, lights and battery."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import EffectorDevice, Motion, UObject, number, owned, reading, set_range
from urbihw.platforms.arrival import LINK_DOWN
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.hooks import LimitNamer, LimitTable
from urbihw.platforms.limits import DeviceLimits, whole_counts
from urbihw.platforms.measured import MeasuredDevice
from urbihw.platforms.spykee import protocol as p
from urbihw.platforms.spykee import words

DOCKED: Final = "the robot is on its dock: it does not drive before Spykee.chargeStop"
"""The warning for a client that drives a robot on its dock."""


class SpykeeTrack(EffectorDevice):
    """A track: ``val`` is its speed, -100 (backward) to 100.

    The robot measures no speed: the value read is the one ordered, 0 after a stop and while the link is down.
    """

    slot_words = words.TRACK

    val = owned(0.0)

    def init(self, channel: DeviceChannel, motion: Motion, name: str, explain: Callable[[], str]) -> None:
        """Connect to the worker through ``channel``; ``motion`` decides who may move the robot, ``explain`` tells why
        it stands.
        """
        self._channel, self._name, self._explain = channel, name, explain
        set_range(self.val, -p.FULL, p.FULL)
        self._guard = self.guard(motion, name, self.val)
        self.notify_change(self.val, self._write)

    def _write(self) -> None:
        speed = number(self.val)
        self.val.sense(0.0 if self._explain() == LINK_DOWN else speed)
        self._channel.set_target(self._name, "speed", round(speed), self._guard.origin)

    def explain_off(self) -> str:
        """See ``EffectorDevice``; a speed of 0 needs no explanation."""
        return "" if self.requested.sensed == 0 else self._explain()

    def show_stop(self) -> None:
        """Show that the track stands."""
        self.val.sense(0.0)

    def limits_in_counts(self, limits: DeviceLimits, named: LimitNamer) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """Convert the limits of a track: speed in shares of 100, acceleration in shares per second."""
        low, high = whole_counts(-limits.speed, limits.speed)
        return {(self._name, "speed"): m.Limit(low, high, limits.acceleration, named("speed"))}, ()

    def was_limited(self, message: m.Limited) -> None:
        """Show the limited speed."""
        if message.device == self._name:
            self.limit_applied(message.applied, message.limit)
            self.val.sense(float(message.applied))


class SpykeeLed(UObject):
    """A light: on if ``val`` is 1, off if it is 0."""

    slot_words = words.LED

    val = owned(0.0)

    def init(self, channel: DeviceChannel, name: str) -> None:
        """Connect to the worker through ``channel``."""
        self._channel, self._name = channel, name
        set_range(self.val, 0.0, 1.0)
        self.notify_change(self.val, self._write)

    def _write(self) -> None:
        on = number(self.val) >= 0.5
        self._channel.set_target(self._name, "on", int(on))
        self.val.sense(float(on))


class SpykeeBattery(MeasuredDevice):
    """The battery: ``remain`` is a share of 1, the last one that was known while it charges.

    The robot measures neither capacity (A h) nor current (A) nor voltage (V): they are nan.
    """

    slot_words = words.BATTERY

    remain = reading(math.nan)
    charging = reading(False)
    capacity = reading(math.nan)
    current = reading(math.nan)
    voltage = reading(math.nan)

    def init(self) -> None:
        """Nothing to set up: the robot creates the battery."""

    def show_level(self, level: int, stamp: float) -> None:
        """Show a level as the robot sends it: percent, negative while it charges."""
        self.mark_fresh()
        self.charging.sense(level < 0, stamp)
        if level >= 0:
            self.remain.sense(min(level, 100) / 100, stamp)
