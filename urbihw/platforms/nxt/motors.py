"""Motors: the class Servo.

``val`` is the position in degrees since the brick was switched on, ``speed`` a share of full power, -100..100,
regulated by the brick (manual, chapter 24).  ``angle``, ``turn`` and ``torque`` are those of a RotationalMotor of
chapter 22.  Writing ``val``, ``angle`` or ``turn`` lets the worker turn the motor there and hold it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from urbihw.buses import messages as m
from urbihw.kernel.uobject import Effector, EffectorDevice, function, number, owned, reading, set_range, variable
from urbihw.platforms.base import LimitTable, Named
from urbihw.platforms.limits import DeviceLimits, whole_counts
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt.ports import PortDevice

FULL = 100.0


class Servo(PortDevice, EffectorDevice):
    """A motor of the NXT on port "A", "B" or "C"."""

    known_ports = p.OUTPUTS
    items = ("rotation",)

    val = owned(math.nan)
    speed = variable(0.0)
    angle = owned(math.nan)
    turn = owned(math.nan)
    # The brick does not measure it.
    torque = reading(math.nan)

    _guards: Iterable[Effector] = ()

    def init(self, port: str) -> None:
        """``Servo.new("A")``"""
        set_range(self.speed, -FULL, FULL)
        self.settle_on(port)
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
        """Let the motor go: it turns freely until it is told something else."""
        self.aim("coast", True)
        self.speed.sense(0.0)

    @function
    def reset(self) -> None:
        """Let the position be 0 where the motor is now."""
        if self.place is not None:
            self.brick.wire.write(self.place, "rotation", 0, lambda reply: None)

    def take(self, values: Mapping[str, Any], stamp: float) -> bool:
        """See ``PortDevice``."""
        degrees = float(values["rotation"])
        self.val.sense(degrees, stamp)
        self.angle.sense(math.radians(degrees % 360), stamp)
        self.turn.sense(degrees / 360, stamp)
        return True

    def arrived(self) -> None:
        """See ``PortDevice``.  Nothing moves by itself: the speed begins at 0."""
        self.speed.sense(0.0)
        for guard in self._guards:
            guard.device = self.place

    def leaving(self) -> None:
        """See ``PortDevice``."""
        self.aim("power", 0)

    def link_changed(self, up: bool) -> None:
        """See ``PortDevice``."""
        super().link_changed(up)
        self.stopped()

    def stopped(self) -> None:
        """See ``PortDevice``."""
        self.speed.sense(0.0)

    def limits_in_counts(self, limits: DeviceLimits, named: Named) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """See ``platforms.base.Limited``: position in degrees, speed as a share of 100."""
        low, high = whole_counts(-min(limits.speed, FULL), min(limits.speed, FULL))
        table = {
            (self.place, "power"): m.Limit(low, high, limits.acceleration, named("speed")),
            (self.place, "goal"): m.Limit(*limits.position, name=named("position")),
        }
        return table, ()

    def was_limited(self, message: m.Limited) -> None:
        """See ``platforms.base.Limited``."""
        if message.device == self.place:
            self.limit_applied(float(message.applied), message.limit)

    def _speed_written(self, guard: Effector) -> None:
        self.aim("power", round(number(self.speed)), guard.origin)

    def _go(self, degrees: float, guard: Effector) -> None:
        if math.isinf(degrees):
            raise ValueError("there is no such position")
        self.speed.sense(0.0)
        self.aim("goal", degrees, guard.origin)

    def _nearest(self, degrees: float) -> float:
        """The position with this angle that is nearest to where the motor is."""
        now = float(self.val.sensed)
        if math.isnan(now) or math.isinf(degrees):
            raise ValueError("the position of the motor is not known yet")
        return now + (degrees - now + 180) % 360 - 180
