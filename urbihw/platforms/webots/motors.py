"""The motors of a simulated robot: ``Servo`` and ``DifferentialWheels`` of the manual (29.5.1.3 and 29.5.1.6).

Today's Webots has no DifferentialWheels node: the object is one of two motors, which it finds by the name of the pair
(``MOTOR_NAMES``), and its encoder is that of the motor's joint.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import EffectorDevice, finite_number, number, owned, reading, set_range
from urbihw.platforms.hooks import LimitNamer, LimitTable
from urbihw.platforms.limits import DeviceLimits
from urbihw.platforms.measured import MeasuredDevice
from urbihw.platforms.webots import words
from urbihw.platforms.webots.simulator import MOTOR, SimDevice, no_such
from urbihw.platforms.webots.surface import Surface, surface_of

MOTOR_NAMES: Final = ("{0} {1}", "{0} {1} motor", "{1} {0}", "{1} {0} motor", "{1}_{0}")
"""How the motor of one side is called: 0 is the side, 1 the name of the pair."""
LOOSE: Final = "switched off: load = 1 switches it on"


class SimMotor(EffectorDevice, MeasuredDevice):
    """What both have: ``angle`` (rad) is the measured one when read, the target when written; so is ``speed`` (rad/s),
    with which it turns without a target.  ``load = 0`` ends both."""

    slot_words = words.MOTOR

    angle = owned(math.nan)
    speed = owned(math.nan)
    torque = reading(math.nan)
    maxSpeed = owned(math.nan)
    load = owned(1.0)
    node = reading("")

    def begin(self, name: str) -> None:
        """Show a motor of the simulator.  Raises ValueError."""
        self._surface: Surface = surface_of(self)
        device = self._surface.world.device(name, MOTOR)
        self._name = name
        self.node.sense(name)
        self._fastest = float(device.facts.get("max velocity", math.inf))
        self.maxSpeed.sense(self._fastest)
        self._apply_ranges(device)
        self._angle = self.guard(self._surface.motion, name, self.angle)
        self._speed = self.guard(self._surface.motion, name, self.speed)
        self.notify_change(self.angle, self._write_angle)
        self.notify_change(self.speed, self._write_speed)
        self.notify_change(self.maxSpeed, self._write_max_speed)
        self.notify_change(self.load, self._write_load)
        self._surface.add_motor(name, self)

    def _apply_ranges(self, device: SimDevice) -> None:
        low, high = float(device.facts.get("min", -math.inf)), float(device.facts.get("max", math.inf))
        if math.isfinite(low) and math.isfinite(high) and low < high:
            set_range(self.angle, low, high)
        if math.isfinite(self._fastest):
            set_range(self.speed, -self._fastest, self._fastest)
            set_range(self.maxSpeed, 0.0, self._fastest)

    # ---------------------------------------------------------------- written

    def _write_angle(self) -> None:
        if number(self.load):
            self._surface.channel.set_target(self._name, "position", number(self.angle), self._angle.origin, 1.0)

    def _write_speed(self) -> None:
        if number(self.load):
            self._surface.channel.set_target(self._name, "velocity", number(self.speed), self._speed.origin)

    def _write_max_speed(self) -> None:
        value = number(self.maxSpeed)
        self._surface.write(self._name, "max velocity", value)
        self.maxSpeed.sense(value)

    def _write_load(self) -> None:
        on = bool(number(self.load))
        if not on:
            self._surface.stop_motor(self._name, "it was switched off")
        self.load.sense(float(on))

    def explain_off(self) -> str:
        return "" if self.load.sensed else LOOSE

    # ---------------------------------------------------------------- measured

    def show(self, values: Sequence[float], stamp: float) -> None:
        """Show position, speed and torque."""
        position, speed, torque = values
        self.angle.sense(position, stamp)
        self.speed.sense(speed, stamp)
        self.torque.sense(torque, stamp)
        self.mark_fresh()

    def limits_in_counts(self, limits: DeviceLimits, named: LimitNamer) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """See ``LimitedDevice``: a limit of the speed is also how fast a target angle may change."""
        low, high = limits.position
        table: dict[tuple[Any, str], m.Limit] = {}
        table[self._name, "velocity"] = m.Limit(
            -limits.speed, limits.speed, limits.acceleration, named("speed"), named("acceleration")
        )
        table[self._name, "position"] = m.Limit(low, high, limits.speed, named("position"), named("speed"))
        return table, ()

    def was_limited(self, message: m.Limited) -> None:
        if message.device == self._name:
            self.limit_applied(message.applied, message.limit)


class Servo(SimMotor):
    """``Servo.new(name, forceFeedback)``; ``force`` is the torque (N m, or N) that it gives, if that is measured."""

    slot_words = words.SERVO

    force = reading(math.nan)

    def init(self, name: str, forceFeedback: bool = False) -> None:
        self._feedback = forceFeedback
        self.begin(name)

    def show(self, values: Sequence[float], stamp: float) -> None:
        super().show(values, stamp)
        if self._feedback:
            self.force.sense(values[2], stamp)


class DifferentialWheels(SimMotor):
    """``DifferentialWheels.new(name, left)``; ``encoder`` counts ``encoderResolution`` per rad, and may be set."""

    slot_words = words.WHEEL

    encoder = owned(math.nan)
    encoderResolution = owned(100.0)

    def init(self, name: str, left: bool) -> None:
        world = surface_of(self).world
        side = "left" if left else "right"
        motors = [each.name for each in world.devices if each.kind == MOTOR]
        found = [wanted for each in MOTOR_NAMES if (wanted := each.format(side, name)) in motors]
        if not found:
            raise ValueError(no_such(f"{side} wheel of", name, motors))
        self._offset = 0.0
        self._position = math.nan
        self.begin(found[0])
        self.notify_change(self.encoder, self._write_encoder)
        self.notify_change(self.encoderResolution, self._write_resolution)

    def _write_encoder(self) -> None:
        value, resolution = finite_number(self.encoder.value), float(self.encoderResolution.sensed)
        if not math.isnan(self._position):
            self._offset = self._position - value / resolution
        self.encoder.sense(value)

    def _write_resolution(self) -> None:
        value = number(self.encoderResolution)
        if not value > 0:
            raise ValueError("encoderResolution is greater than 0")
        self.encoderResolution.sense(value)

    def show(self, values: Sequence[float], stamp: float) -> None:
        super().show(values, stamp)
        self._position = values[0]
        self.encoder.sense((self._position - self._offset) * float(self.encoderResolution.sensed), stamp)
