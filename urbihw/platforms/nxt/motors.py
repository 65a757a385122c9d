"""Motors: the class Servo.

``val`` is the position in degrees since the brick was switched on, ``speed`` a share of full power, -100..100,
regulated by the brick (manual, chapter 24).  ``angle``, ``turn`` and ``torque`` belong to RotationalMotor (chapter 22).
A write of ``val``, ``angle`` or ``turn`` makes the worker turn the motor to that position and hold it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from urbihw.buses import messages as m
from urbihw.kernel.uobject import (
    Effector,
    EffectorDevice,
    Origin,
    function,
    number,
    owned,
    reading,
    set_range,
    variable,
)
from urbihw.platforms.hooks import LimitNamer, LimitTable
from urbihw.platforms.limits import DeviceLimits, whole_counts
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt import words
from urbihw.platforms.nxt.ports import PortDevice

FULL = 100.0


class NxtServo(PortDevice, EffectorDevice):
    """A motor of the NXT on port "A", "B" or "C"."""

    uname = "Servo"
    slot_words = words.MOTOR

    known_ports = p.OUTPUTS
    items = ("rotation",)

    val = owned(math.nan)
    speed = variable(0.0)
    angle = owned(math.nan)
    turn = owned(math.nan)
    # The brick does not measure it.
    torque = reading(math.nan)

    is_counting = True
    """False from a request to reset the position until its execution: until then a count may be old or new."""

    _guards: Iterable[Effector] = ()

    def init(self, port: str) -> None:
        """``Servo.new("A")``"""
        set_range(self.speed, -FULL, FULL)
        self.claim_first_port(port)
        motion = self.brick.motion
        guards = {var.name: self.guard(motion, port, var) for var in (self.speed, self.val, self.turn, self.angle)}
        self._guards = guards.values()
        self.notify_change(self.speed, lambda: self._speed_written(guards["speed"]))
        self.notify_change(self.val, lambda: self._go(number(self.val), guards["val"]))
        self.notify_change(self.turn, lambda: self._go(number(self.turn) * 360, guards["turn"]))
        self.notify_change(
            self.angle, lambda: self._go(self._nearest(math.degrees(number(self.angle))), guards["angle"])
        )

    @function
    def coast(self) -> None:
        """Switch the motor off: it turns freely until the next write."""
        self.brick.end_path(self)
        self.set_target("coast", True)
        self.speed.sense(0.0)

    @function
    def reset(self) -> None:
        """Set the position to 0 where the motor is now."""
        if self.place is not None:
            self.is_counting = False
            self.brick.channel.write(self.place, "rotation", 0, self._was_reset)

    def _was_reset(self, reply: m.Reply) -> None:
        self.is_counting = True

    def run_at(self, power: int, origin: Origin) -> None:
        """Turn at a speed of -100 to 100, for the planner."""
        self.speed.sense(float(power))
        self.set_target("power", power, origin)

    def show_values(self, values: Mapping[str, Any], stamp: float) -> bool:
        """Show the rotation count as degrees, as an angle and as turns."""
        degrees = float(values["rotation"])
        self.val.sense(degrees, stamp)
        self.angle.sense(math.radians(degrees % 360), stamp)
        self.turn.sense(degrees / 360, stamp)
        return True

    def set_up_port(self) -> None:
        """Start with speed 0, and bind the slots' guards to the new port."""
        self.speed.sense(0.0)
        for guard in self._guards:
            guard.device = self.place

    def leave_port(self) -> None:
        """End a path that uses the motor, and stop it."""
        self.brick.end_path(self)
        self.set_target("power", 0)

    def link_changed(self, up: bool) -> None:
        """Also show the speed 0 after each change of the link."""
        super().link_changed(up)
        self.stopped()

    def stopped(self) -> None:
        """Show the speed 0."""
        self.speed.sense(0.0)

    def limits_in_counts(self, limits: DeviceLimits, named: LimitNamer) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """Convert the limits of the motor: position in degrees, speed as a share of 100."""
        low, high = whole_counts(-min(limits.speed, FULL), min(limits.speed, FULL))
        table = {
            (self.place, "power"): m.Limit(low, high, limits.acceleration, named("speed")),
            (self.place, "goal"): m.Limit(*limits.position, name=named("position")),
        }
        return table, ()

    def was_limited(self, message: m.Limited) -> None:
        """Show the limited target if it was one of this motor."""
        if message.device == self.place:
            self.limit_applied(float(message.applied), message.limit)

    def _speed_written(self, guard: Effector) -> None:
        power = round(number(self.speed))
        self.brick.end_path(self)
        self.set_target("power", power, guard.origin)

    def _go(self, degrees: float, guard: Effector) -> None:
        if math.isinf(degrees):
            raise ValueError("there is no such position")
        self.brick.end_path(self)
        self.speed.sense(0.0)
        self.set_target("goal", degrees, guard.origin, 1.0)

    def _nearest(self, degrees: float) -> float:
        """Return the position with this angle that is nearest to the present one."""
        now = float(self.val.sensed)
        if math.isnan(now) or math.isinf(degrees):
            raise ValueError("the position of the motor is not known yet")
        return now + (degrees - now + 180) % 360 - 180
