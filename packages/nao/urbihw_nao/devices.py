"""Lights, sensors and the battery."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final

from urbihw.kernel.uobject import UObject, UVar, number, owned, reading, set_range
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.measured import MeasuredDevice
from urbihw_nao import words
from urbihw_nao.light_part import LED
from urbihw_nao.lights import COLOURS, Levels, LightBoard


class NaoLed(UObject):
    """A light or a group of lights: ``val`` (0 to 1), ``r``, ``g``, ``b`` (0 to 1), ``rgb`` (0xRRGGBB).

    What is read is what was written here, to this light or to one that has actuators in common with it: NAOqi tells no
    colours.
    A group of lights that differ shows of each colour the brightest.  A light of one colour (the ears, which are blue,
    the top of the head, and the groups of one colour) is as bright as the brightest part that was written.
    """

    slot_words = words.LED

    val = owned(0.0)
    r = owned(0.0)
    g = owned(0.0)
    b = owned(0.0)
    rgb = owned(0.0)

    def init(self, channel: DeviceChannel, board: LightBoard, name: str) -> None:
        """``name`` is that of NAOqi."""
        self._channel, self._board, self._name = channel, board, name
        board.join(name, lambda levels: self._show(_colour(levels), max(levels)))
        for var in (self.val, self.r, self.g, self.b):
            set_range(var, 0.0, 1.0)
        set_range(self.rgb, 0.0, float(0xFFFFFF))
        self.notify_change(self.val, self._write_level)
        self.notify_change(self.rgb, lambda: self._write_colour(round(number(self.rgb))))
        self.notify_change(self.r, lambda: self._write_part(self.r, "Red"))
        self.notify_change(self.g, lambda: self._write_part(self.g, "Green"))
        self.notify_change(self.b, lambda: self._write_part(self.b, "Blue"))

    def _write_level(self) -> None:
        level = number(self.val)
        self._write(round(level * 255) * 0x010101, level, COLOURS)

    def _write_part(self, part: UVar, name: str) -> None:
        shift = _SHIFTS[name]
        colour = round(self.rgb.sensed) & ~(0xFF << shift) | round(number(part) * 255) << shift
        self._write_colour(colour, (name,))

    def _write_colour(self, colour: int, parts: Iterable[str] = COLOURS) -> None:
        self._write(colour, max(_part(colour, name) for name in COLOURS), parts)

    def _write(self, colour: int, level: float, parts: Iterable[str]) -> None:
        written = {name: _part(colour, name) for name in parts}
        for call in self._board.write(self._name, written, level):
            self._channel.set_target((LED, call.name), call.item, call.value)
        self._show(colour, level)

    def _show(self, colour: int, level: float) -> None:
        self.rgb.sense(float(colour))
        self.val.sense(level)
        for var, name in ((self.r, "Red"), (self.g, "Green"), (self.b, "Blue")):
            var.sense(_part(colour, name))


_SHIFTS: Final = {"Red": 16, "Green": 8, "Blue": 0}


def _part(colour: int, name: str) -> float:
    return (colour >> _SHIFTS[name] & 0xFF) / 255


def _colour(levels: Levels) -> int:
    red, green, blue = (round(level * 255) for level in levels)
    return red << 16 | green << 8 | blue


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

    NAOqi measures neither its voltage nor its capacity (V, A h): both are nan.
    """

    slot_words = words.BATTERY

    remain = reading(math.nan)
    current = reading(math.nan)
    voltage = reading(math.nan)
    capacity = reading(math.nan)

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
