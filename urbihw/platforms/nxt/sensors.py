"""Sensors: UltraSonicSensor, SoundSensor, LightSensor and Switch of the manual (chapter 24), and two more.

``val`` is in the manual's units: cm, 0..1, 0 or 1.  The slots of the interfaces of chapter 22, ``distance`` in m
and ``pressure``, have the same value.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Final

from urbihw.kernel.uobject import event, function, reading, variable
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt import words
from urbihw.platforms.nxt.i2c import NO_ECHO
from urbihw.platforms.nxt.ports import PortDevice

FULL: Final = 1023
_MODE_BITS: Final = 0xE0

Setting = tuple[int, int]
"""Type and mode of an input."""


class Sensor(PortDevice):
    """Base of the sensors."""

    slot_words = words.SENSOR

    known_ports = p.INPUTS
    val = reading(math.nan)

    def setting(self) -> Setting:
        """Return the setting of the port; override."""
        raise NotImplementedError

    def set_up_port(self) -> None:
        """Set the type and mode of the new port."""
        self.set_target("mode", self.setting())


class AnalogSensor(Sensor):
    """A sensor with a voltage as its output; ``raw`` is the measured value, 0..1023."""

    items = ("raw",)
    pace = 0.02

    raw = reading(math.nan)

    def show_values(self, values: Mapping[str, Any], stamp: float) -> bool:
        """Show the values, unless they were measured in another mode."""
        if (values["kind"], values["mode"] & _MODE_BITS) != self.setting():
            return False
        self.raw.sense(float(values["raw"]), stamp)
        self.measured(values, stamp)
        return True

    def measured(self, values: Mapping[str, Any], stamp: float) -> None:
        """Show valid values; override."""
        raise NotImplementedError


class ModalSensor(AnalogSensor):
    """A sensor with modes; ``mode`` is one of ``modes``."""

    modes: ClassVar[Mapping[str, Setting]] = {}
    mode = variable("")

    def begin(self, port: int, mode: str) -> None:
        """Called by ``init``."""
        self._check(mode)
        self.mode.sense(mode)
        self.claim_first_port(port)
        self.notify_change(self.mode, self._mode_written)

    def setting(self) -> Setting:
        """Return the row of ``modes`` that ``mode`` names."""
        return self.modes[str(self.mode.value)]

    def _mode_written(self) -> None:
        self._check(self.mode.value)
        self.stale.sense(True)
        self.set_up_port()

    def _check(self, mode: Any) -> None:
        if not isinstance(mode, str) or mode not in self.modes:
            known = ", ".join(f'"{each}"' for each in self.modes)
            raise ValueError(f"the modes of a {self.urbi_class()} are {known}")


class SoundSensor(ModalSensor):
    """Loudness, 0..1; "DBA" is adapted to the ear, "DB" is the whole band."""

    slot_words = words.SOUND

    modes = {"DBA": (p.SOUND_DBA, p.PERCENT), "DB": (p.SOUND_DB, p.PERCENT)}

    def init(self, port: int, mode: str = "DBA") -> None:
        """``SoundSensor.new(1, "DBA")``"""
        self.begin(port, mode)

    def measured(self, values: Mapping[str, Any], stamp: float) -> None:
        """Show the loudness as a share of full scale."""
        self.val.sense(values["normalised"] / FULL, stamp)


class NxtLightSensor(ModalSensor):
    """Brightness, 0..1: with the LED on in "Reflector", off in "Ambient"; 0..1023 in "Normal", with the LED off."""

    uname = "LightSensor"
    slot_words = words.LIGHT

    modes = {
        "Reflector": (p.LIGHT_ACTIVE, p.PERCENT),
        "Ambient": (p.LIGHT_INACTIVE, p.PERCENT),
        "Normal": (p.LIGHT_INACTIVE, p.RAW),
    }

    def init(self, port: int, mode: str = "Reflector") -> None:
        """``LightSensor.new(3, "Reflector")``"""
        self.begin(port, mode)

    def measured(self, values: Mapping[str, Any], stamp: float) -> None:
        """Show the brightness as a share, or as 0..1023 in mode "Normal"."""
        self.val.sense(float(values["scaled"]) if self.is_raw else values["normalised"] / FULL, stamp)

    def set_up_port(self) -> None:
        """Also show the unit of the mode."""
        super().set_up_port()
        self.val.set_property("unit", "1" if self.is_raw else "ratio")

    @property
    def is_raw(self) -> bool:
        """Whether ``val`` is the raw value."""
        return bool(self.mode.value == "Normal")


class NxtSwitch(AnalogSensor):
    """A touch sensor: 1 while pressed, else 0."""

    uname = "Switch"
    slot_words = words.SWITCH

    pressure = reading(math.nan)

    def init(self, port: int) -> None:
        """``Switch.new(4)``"""
        self.claim_first_port(port)

    def setting(self) -> Setting:
        """Return the setting of a touch sensor: true or false."""
        return p.SWITCH, p.BOOLEAN

    def measured(self, values: Mapping[str, Any], stamp: float) -> None:
        """Show 1 if pressed, else 0."""
        self.val.sense(float(values["scaled"]), stamp)
        self.pressure.sense(float(values["scaled"]), stamp)


class ColourSensor(AnalogSensor):
    """A colour sensor (of the NXT 2.0): ``val`` is 1..6, ``colour`` its name."""

    slot_words = words.COLOUR

    COLOURS: ClassVar = {1: "black", 2: "blue", 3: "green", 4: "yellow", 5: "red", 6: "white"}
    colour = reading("")

    def init(self, port: int) -> None:
        """``ColourSensor.new(3)``"""
        self.claim_first_port(port)

    def setting(self) -> Setting:
        """Return the setting of a colour sensor."""
        return p.COLOUR, p.RAW

    def measured(self, values: Mapping[str, Any], stamp: float) -> None:
        """Show the number of the colour and its name."""
        self.val.sense(float(values["scaled"]), stamp)
        self.colour.sense(self.COLOURS.get(values["scaled"], ""))


class UltraSonicSensor(Sensor):
    """Distance in cm, 0..255; 255 without an echo, or if the sensor cannot be read.  ``distance`` is in m."""

    slot_words = words.ECHO

    items = ("distance",)
    pace = 0.05

    distance = reading(math.nan)

    def init(self, port: int) -> None:
        """``UltraSonicSensor.new(2)``"""
        self.claim_first_port(port)

    def setting(self) -> Setting:
        """Return the setting of a sensor on the I2C bus with 9 V."""
        return p.LOWSPEED_9V, p.RAW

    def show_values(self, values: Mapping[str, Any], stamp: float) -> bool:
        """Show the distance in cm and in m; without an echo, ``distance`` is inf."""
        centimetres = float(values["distance"])
        self.val.sense(centimetres, stamp)
        self.distance.sense(math.inf if centimetres >= NO_ECHO else centimetres / 100, stamp)
        return True


class I2CSensor(PortDevice):
    """Any sensor on the I2C bus; ``address`` in the 8-bit form of the makers' data sheets (2 for most).

    ``read(register, count)`` and ``write(register, bytes)`` are in nxt.u; each waits for its answer.
    """

    slot_words = words.I2C

    known_ports = p.INPUTS

    address = variable(2.0)
    answered = event()

    def init(self, port: int, address: int = 2) -> None:
        """``I2CSensor.new(1, 2)``"""
        if not 0 <= address <= 254 or address % 2:
            raise ValueError("an I2C address is an even number from 0 to 254")
        self.address.sense(float(address))
        self.count = 0
        self.claim_first_port(port)

    def set_up_port(self) -> None:
        """Set the port to I2C.  The sensor is read on request only, so its values are never stale."""
        self.set_target("mode", (p.LOWSPEED_9V, p.RAW))
        self.stale.sense(False)

    @function
    def transfer(self, data: list[Any], count: int) -> int:
        """Write bytes, a register first, and read ``count``; ``answered`` is emitted with the returned number and a
        list, or a text with the error."""
        if not 1 <= len(data) <= 15 or not 0 <= count <= 16:
            raise ValueError("a transfer writes 1 to 15 bytes and reads at most 16")
        if self.place is None:
            raise ValueError("this sensor is on no port")
        self.count += 1
        number = self.count
        sent = bytes([int(self.address.value), *octets(data)])
        self.brick.channel.write(
            self.place,
            "i2c",
            (sent, count),
            lambda reply: self.answered.emit(number, list(map(float, reply.value)) if reply.ok else reply.error),
        )
        return number


def octets(values: list[Any]) -> bytes:
    """Convert an urbiscript list to bytes.  Raises ValueError."""
    if not all(isinstance(value, int | float) and value == int(value) and 0 <= value <= 255 for value in values):
        raise ValueError("this takes a list of integers from 0 to 255")
    return bytes(map(int, values))
