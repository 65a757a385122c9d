"""Lights, sensors and the battery."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from urbihw.kernel.uobject import NIL, UObject, UVar, number, owned, reading, set_range
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.measured import MeasuredDevice
from urbihw_nao import words
from urbihw_nao.light_part import LED

ONE_COLOUR_PARTS: Final = ("Ear", "Brain")
"""Parts of the names of lights and groups that have one colour (fact sheet, section 10)."""
ONE_COLOUR_ENDS: Final = ("Red", "Green", "Blue")
"""Ends of the names of groups that are the lights of one colour."""


class NaoLed(UObject):
    """A light or a group of lights: ``val`` (0 to 1), ``r``, ``g``, ``b`` (0 to 1), ``rgb`` (0xRRGGBB).

    What is read is what was written here: NAOqi tells no colours, and a group shows nothing of what was written to its
    lights one by one.  A light of one colour (the ears, which are blue, the top of the head, and the groups of one
    colour) is as bright as the brightest part that was written.
    """

    slot_words = words.LED

    val = owned(0.0)
    r = owned(0.0)
    g = owned(0.0)
    b = owned(0.0)
    rgb = owned(0.0)

    def init(self, channel: DeviceChannel, name: str) -> None:
        """``name`` is that of NAOqi."""
        self._channel, self._device = channel, (LED, name)
        self._has_colours = not name.endswith(ONE_COLOUR_ENDS) and not any(part in name for part in ONE_COLOUR_PARTS)
        for var in (self.val, self.r, self.g, self.b):
            set_range(var, 0.0, 1.0)
        set_range(self.rgb, 0.0, float(0xFFFFFF))
        self.notify_change(self.val, self._write_level)
        self.notify_change(self.rgb, lambda: self._write_colour(round(number(self.rgb))))
        self.notify_change(self.r, lambda: self._write_part(self.r, 16))
        self.notify_change(self.g, lambda: self._write_part(self.g, 8))
        self.notify_change(self.b, lambda: self._write_part(self.b, 0))

    def _write_level(self) -> None:
        level = number(self.val)
        self._write(round(level * 255) * 0x010101, level)

    def _write_part(self, part: UVar, shift: int) -> None:
        others = round(self.rgb.sensed) & ~(0xFF << shift)
        self._write_colour(others | round(number(part) * 255) << shift)

    def _write_colour(self, colour: int) -> None:
        parts = [colour >> shift & 0xFF for shift in (16, 8, 0)]
        self._write(colour, max(parts) / 255)

    def _write(self, colour: int, level: float) -> None:
        if self._has_colours:
            self._channel.set_target(self._device, "rgb", colour)
        else:
            self._channel.set_target(self._device, "level", level)
        self.rgb.sense(float(colour))
        self.val.sense(level)
        for var, shift in ((self.r, 16), (self.g, 8), (self.b, 0)):
            var.sense((colour >> shift & 0xFF) / 255)


class NaoSensor(MeasuredDevice):
    """A sensor of one value."""

    slot_words = words.SENSOR

    val = reading(math.nan)

    def init(self, item: str) -> None:
        """``item`` is its name in the worker."""
        self.item = item

    def show(self, values: Mapping[str, float], stamp: float) -> None:
        """Show what was measured."""
        self.mark_fresh()
        if self.item in values:
            self.val.sense(values[self.item], stamp)


class NaoBumper(NaoSensor):
    """The two switches of a foot: 1 if any is pressed."""

    def show(self, values: Mapping[str, float], stamp: float) -> None:
        self.mark_fresh()
        both = [values[self.item + side] for side in ("L", "R") if self.item + side in values]
        if both:
            self.val.sense(max(both), stamp)


class NaoBattery(MeasuredDevice):
    """The battery: ``remain`` is a share of 1, ``current`` in A, negative while it drains.

    NAOqi measures neither its voltage nor its capacity (V, A h): both are nil.
    """

    slot_words = words.BATTERY

    remain = reading(math.nan)
    current = reading(math.nan)
    voltage = reading(NIL)
    capacity = reading(NIL)

    def init(self) -> None:
        """Made by the robot."""

    def show(self, values: Mapping[str, float], stamp: float) -> None:
        """Show what was measured."""
        self.mark_fresh()
        for var, item in ((self.remain, "charge"), (self.current, "current")):
            if item in values:
                var.sense(values[item], stamp)


class NaoFsr(MeasuredDevice):
    """What the feet feel: ``left``, ``right`` and ``val`` (both) are 1 on the ground; weights in kg."""

    slot_words = words.FSR

    val = reading(math.nan)
    left = reading(math.nan)
    right = reading(math.nan)
    leftFootTotalWeight = reading(math.nan)
    rightFootTotalWeight = reading(math.nan)

    def init(self) -> None:
        """Made by the robot."""

    def show(self, values: Mapping[str, float], stamp: float) -> None:
        """Show what was measured."""
        self.mark_fresh()
        rows = (
            (self.left, "contactL"), (self.right, "contactR"),
            (self.leftFootTotalWeight, "weightL"), (self.rightFootTotalWeight, "weightR"),
        )  # fmt: skip
        for var, item in rows:
            if item in values:
                var.sense(values[item], stamp)
        if "contactL" in values and "contactR" in values:
            self.val.sense(min(values["contactL"], values["contactR"]), stamp)


SENSOR_OBJECTS: Mapping[str, tuple[type[NaoSensor], str]] = {
    "sonarL": (NaoSensor, "sonarL"), "sonarR": (NaoSensor, "sonarR"),
    "footTouchL": (NaoBumper, "bumperL"), "footTouchR": (NaoBumper, "bumperR"),
    "headSensorF": (NaoSensor, "headTouchF"), "headSensorM": (NaoSensor, "headTouchM"),
    "headSensorR": (NaoSensor, "headTouchR"),
    "accelX": (NaoSensor, "accelX"), "accelY": (NaoSensor, "accelY"), "accelZ": (NaoSensor, "accelZ"),
    "gyroX": (NaoSensor, "gyroX"), "gyroY": (NaoSensor, "gyroY"),
}  # fmt: skip
"""The sensors of the manual by the names of their objects: class, and item of the worker."""
