"""The sensors of a simulated robot (manual, 29.5.1, and those that today's robots have beside)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar, Final

from urbihw.kernel.uobject import UObject, function, number, owned, reading, variable
from urbihw.platforms.measured import MeasuredDevice
from urbihw.platforms.webots import simulator as s
from urbihw.platforms.webots import words
from urbihw.platforms.webots.surface import surface_of

AXES: Final = "xyz"


class SimSensor(MeasuredDevice):
    """The base: ``load = 0`` ends the sampling of the device in the simulator, for all its objects."""

    slot_words = words.SENSOR

    kind: ClassVar[str]
    period: ClassVar[float] = 0.0

    load = owned(1.0)
    node = reading("")

    def init(self, name: str) -> None:
        """``new(name)``.  Raises ValueError for a name that no device of this kind has."""
        self._surface = surface_of(self)
        self.device = self._surface.world.device(name, self.kind)
        self.node.sense(name)
        self.notify_change(self.load, lambda: self._surface.switch(name, bool(number(self.load))))
        self._surface.add_device(name, self, self.period)

    def fact(self, name: str, missing: float = math.nan) -> float:
        """Return a number of the device that does not change."""
        return float(self.device.facts.get(name, missing))

    def show(self, value: Any, stamp: float) -> None:
        """Show a sample of the device."""
        self.sensed(value, stamp)
        self.mark_fresh()

    def sensed(self, value: Any, stamp: float) -> None:
        """Put a sample into the slots."""
        raise NotImplementedError


class Accelerometer(SimSensor):
    """``Accelerometer.new(name, component)``: one of "x", "y", "z", in m/s2; at rest the vertical one is 9.81."""

    slot_words = words.ACCELEROMETER
    kind = s.ACCELEROMETER
    acceleration = reading(math.nan)

    def init(self, name: str, component: str) -> None:  # type: ignore[override]
        self._axis = axis_of(component)
        super().init(name)

    def sensed(self, value: Sequence[float], stamp: float) -> None:
        self.acceleration.sense(value[self._axis], stamp)


class Gyro(SimSensor):
    """``Gyro.new(name, component)``: rad/s about one of "x", "y", "z"."""

    slot_words = words.GYRO
    kind = s.GYRO
    speed = reading(math.nan)

    def init(self, name: str, component: str) -> None:  # type: ignore[override]
        self._axis = axis_of(component)
        super().init(name)

    def sensed(self, value: Sequence[float], stamp: float) -> None:
        self.speed.sense(value[self._axis], stamp)


def axis_of(component: str) -> int:
    """Return the number of an axis.  Raises ValueError."""
    if component not in ("x", "y", "z"):
        raise ValueError(f'the component is "x", "y" or "z", not {component!r}')
    return AXES.index(component)


class _Place(SimSensor):
    """Three numbers with names of their own; ``val`` has them as a list."""

    val = reading([math.nan] * 3)

    def names(self) -> tuple[str, str, str]:
        """The names of the slots."""
        return "x", "y", "z"

    def init(self, name: str) -> None:
        """``new(name)``"""
        super().init(name)

    def sensed(self, value: Sequence[float], stamp: float) -> None:
        for slot, each in zip(self.names(), value, strict=True):
            self.variables[slot].sense(each, stamp)
        self.val.sense([float(each) for each in value], stamp)


class GPS(_Place):
    """``GPS.new(name)``: where the device is in the world, in m."""

    slot_words = words.GPS
    kind = s.GPS
    x = reading(math.nan)
    y = reading(math.nan)
    z = reading(math.nan)


class Compass(_Place):
    """``Compass.new(name)``: the direction of the north (the world's y axis) seen by the device; ``angle`` is the
    heading to the left of east, in rad."""

    slot_words = words.COMPASS
    kind = s.COMPASS
    x = reading(math.nan)
    y = reading(math.nan)
    z = reading(math.nan)
    angle = reading(math.nan)

    def sensed(self, value: Sequence[float], stamp: float) -> None:
        super().sensed(value, stamp)
        self.angle.sense(math.atan2(value[0], value[1]), stamp)


class InertialUnit(_Place):
    """``InertialUnit.new(name)``: roll, pitch and yaw, in rad."""

    slot_words = words.INERTIAL
    kind = s.INERTIAL_UNIT
    roll = reading(math.nan)
    pitch = reading(math.nan)
    yaw = reading(math.nan)

    def names(self) -> tuple[str, str, str]:
        return "roll", "pitch", "yaw"


class DistanceSensor(SimSensor):
    """``DistanceSensor.new(name)``: the simulator's value times ``factor``."""

    slot_words = words.DISTANCE
    kind = s.DISTANCE_SENSOR
    distance = reading(math.nan)
    factor = variable(1.0)

    def sensed(self, value: float, stamp: float) -> None:
        self.distance.sense(value * number(self.factor), stamp)


class TouchSensor(SimSensor):
    """``TouchSensor.new(name)``: 1 and 0 of a bumper, else the force, in N."""

    slot_words = words.TOUCH
    kind = s.TOUCH_SENSOR
    pressure = reading(math.nan)

    def sensed(self, value: Any, stamp: float) -> None:
        """See ``SimSensor``; of a force in three directions, its amount."""
        self.pressure.sense(math.hypot(*value) if isinstance(value, tuple) else value, stamp)


class LightSensor(SimSensor):
    """``LightSensor.new(name)``"""

    slot_words = words.LIGHT
    kind = s.LIGHT_SENSOR
    val = reading(math.nan)

    def sensed(self, value: float, stamp: float) -> None:
        self.val.sense(value, stamp)


class PositionSensor(SimSensor):
    """``PositionSensor.new(name)``: rad, or m; it counts on over whole turns."""

    slot_words = words.POSITION
    kind = s.POSITION_SENSOR
    val = reading(math.nan)

    def sensed(self, value: float, stamp: float) -> None:
        self.val.sense(value, stamp)


class Lidar(SimSensor):
    """``Lidar.new(name)``: distances in m from the left to the right; inf where nothing is."""

    slot_words = words.LIDAR
    kind = s.LIDAR
    val = reading([])
    angleMin = reading(math.nan)
    angleMax = reading(math.nan)
    resolution = reading(math.nan)
    distanceMin = reading(math.nan)
    distanceMax = reading(math.nan)
    rate = reading(math.nan)

    def init(self, name: str) -> None:
        super().init(name)
        fov, width = self.fact("fov"), self.fact("width")
        self.angleMin.sense(-fov / 2)
        self.angleMax.sense(fov / 2)
        self.resolution.sense(fov / max(width - 1, 1))
        self.distanceMin.sense(self.fact("min", 0.0))
        self.distanceMax.sense(self.fact("max"))
        self.rate.sense(1000 / self._surface.world.step_ms)

    def sensed(self, value: Sequence[float], stamp: float) -> None:
        self.val.sense([float(each) for each in value], stamp)


class RangeFinder(SimSensor):
    """``RangeFinder.new(name)``: a picture of distances, in m, row by row."""

    slot_words = words.RANGES
    kind = s.RANGE_FINDER
    val = reading([])
    width = reading(math.nan)
    height = reading(math.nan)
    xfov = reading(math.nan)
    distanceMax = reading(math.nan)

    def init(self, name: str) -> None:
        super().init(name)
        facts = (self.width, "width"), (self.height, "height"), (self.xfov, "fov"), (self.distanceMax, "max")
        for var, fact in facts:
            var.sense(self.fact(fact))

    def sensed(self, value: Sequence[float], stamp: float) -> None:
        self.val.sense([float(each) for each in value], stamp)


class Led(UObject):
    """``Led.new(name)``: ``val`` from 0 to 1."""

    slot_words = words.LED
    val = owned(0.0)
    node = reading("")

    def init(self, name: str) -> None:
        surface = surface_of(self)
        surface.world.device(name, s.LED)
        self.node.sense(name)
        self.notify_change(self.val, lambda: self._write(surface.write, name))

    def _write(self, write: Any, name: str) -> None:
        value = number(self.val)
        if not 0 <= value <= 1:
            raise ValueError("val of a Led is 0 to 1")
        if value != self.val.sensed:
            write(name, "value", value)
            self.val.sense(value)


class Emitter(UObject):
    """``Emitter.new(name)``: ``send(text)`` reaches the receivers of its channel."""

    slot_words = words.EMITTER
    channel = reading(math.nan)

    def init(self, name: str) -> None:
        self._surface = surface_of(self)
        device = self._surface.world.device(name, s.EMITTER)
        self._name = name
        self.channel.sense(float(device.facts.get("channel", math.nan)))

    @function("send")
    def send_packet(self, data: bytes) -> None:
        """Send a String or a Binary with the next step."""
        self._surface.write(self._name, "packet", data)
