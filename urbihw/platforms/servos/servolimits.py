"""Limits of the settings as registers of a servo: from SI to raw counts."""

from __future__ import annotations

import math
from typing import Final

from urbihw.buses import messages as m
from urbihw.buses.servos import units
from urbihw.buses.servos.item import Item
from urbihw.frozen import frozen
from urbihw.platforms.hooks import LimitNamer
from urbihw.platforms.limits import DeviceLimits, whole_counts
from urbihw.platforms.servos.frame import JointFrame

TEMPERATURE_HYSTERESIS: Final = 5
"""Degrees Celsius below a threshold at which it is left again."""
VOLTAGE_HYSTERESIS: Final = 3
"""Tenths of a volt inside a threshold at which it is left again."""
_TENTHS: Final = 10  # counts of present_voltage for 1 V

Table = dict[tuple[int, str], m.Limit]


@frozen(slots=False)
class ServoLimits:
    """The limits of one servo; ``named`` returns the names of the settings."""

    number: int
    limits: DeviceLimits
    named: LimitNamer

    def joint_limits(self, goal: Item, frame: JointFrame) -> Table:
        """Return the position and rate limit of the goal; ``frame`` is that of the joint."""
        zero, step = units.to_si(goal, 0), units.to_si(goal, 1) - units.to_si(goal, 0)
        low, high = whole_counts(*sorted((frame.servo(value) - zero) / step for value in self.limits.position))
        name = self.named("position" if math.isinf(self.limits.speed) else "speed")
        if not math.isinf(low) or not math.isinf(high):
            name = self.named("position")
        return {(self.number, goal.name): m.Limit(low, high, self.limits.speed / step, name)}

    def wheel_limits(self, item: str, slope: float) -> Table:
        """Return the speed and acceleration limit of a wheel; ``slope`` is counts for 1 rad/s."""
        slope = abs(slope)
        low, high = whole_counts(-self.limits.speed * slope, self.limits.speed * slope)
        return {(self.number, item): m.Limit(low, high, self.limits.acceleration * slope, self.named("speed"))}

    def torque_limits(self, item: str, strongest: int, drives: bool) -> Table:
        """Return the limit of the torque limit register; ``drives``: in the present mode it drives the servo."""
        if math.isinf(self.limits.torque):
            return {}
        low = -strongest if drives else -math.inf
        return {(self.number, item): m.Limit(low=low, high=strongest, name=self.named("torque"))}

    def thresholds(self, torque: str, strongest: int, drives: bool) -> list[m.Threshold]:
        """Return the thresholds: temperature (warning, half the torque, no torque) and voltage (warning).

        ``torque`` is the torque limit register, "" for none.  Where it drives the servo in the present mode, the drive
        ends instead of being halved.
        """
        warn, reduce, release = self.limits.temperature
        low, high = self.limits.voltage
        hot, volts = "present_temperature", "present_voltage"
        half: tuple[tuple[str, int], ...] = ((torque, 0 if drives else strongest // 2),) if torque else ()
        full: tuple[tuple[str, int], ...] = ((torque, strongest),) if torque and not drives else ()
        off = (("torque_enable", 0),)
        name, voltage = self.named("temperature"), self.named("voltage")
        rows = [
            m.Threshold(self.number, hot, warn, f"{name} (warn)", hysteresis=TEMPERATURE_HYSTERESIS),
            m.Threshold(self.number, hot, reduce, f"{name} (reduce)", True, TEMPERATURE_HYSTERESIS, half, full),
            m.Threshold(
                self.number, hot, release, f"{name} (release)", True, TEMPERATURE_HYSTERESIS, off, holds=True,
                advice=f"let it cool below {release - TEMPERATURE_HYSTERESIS:g} degrees, then load = 1",
            ),
            m.Threshold(self.number, volts, low * _TENTHS, voltage, above=False, hysteresis=VOLTAGE_HYSTERESIS),
            m.Threshold(self.number, volts, high * _TENTHS, voltage, hysteresis=VOLTAGE_HYSTERESIS),
        ]
        return [row for row in rows if math.isfinite(row.level)]
