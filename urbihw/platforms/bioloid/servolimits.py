"""Limits of the settings as registers of a servo: from SI to raw counts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from urbihw.buses import messages as m
from urbihw.buses.dynamixel import units
from urbihw.buses.dynamixel.item import Item
from urbihw.platforms.base import Named
from urbihw.platforms.limits import DeviceLimits, whole_counts

COOLER: Final = 5
"""Degrees C below a limit at which it is left again."""
BETTER: Final = 3
"""Tenths of a volt inside a limit at which it is left again."""
_TENTHS: Final = 10  # counts of present_voltage for 1 V

Table = dict[tuple[int, str], m.Limit]


@dataclass(frozen=True)
class ServoLimits:
    """The limits of one servo; ``named`` says how the settings call them."""

    number: int
    limits: DeviceLimits
    named: Named

    def joint(self, goal: Item) -> Table:
        """Where the goal may lie, and how fast it may go there."""
        zero, step = units.to_si(goal, 0), units.to_si(goal, 1) - units.to_si(goal, 0)
        low, high = whole_counts(*((value - zero) / step for value in self.limits.position))
        name = self.named("position" if math.isinf(self.limits.speed) else "speed")
        if not math.isinf(low) or not math.isinf(high):
            name = self.named("position")
        return {(self.number, goal.name): m.Limit(low, high, self.limits.speed / step, name)}

    def wheel(self, item: str, slope: float) -> Table:
        """How fast a wheel may turn, and change that; ``slope`` is counts for 1 rad/s."""
        low, high = whole_counts(-self.limits.speed * slope, self.limits.speed * slope)
        return {(self.number, item): m.Limit(low, high, self.limits.acceleration * slope, self.named("speed"))}

    def torque(self, item: str, strongest: int) -> Table:
        """How large the torque limit may be."""
        if math.isinf(self.limits.torque):
            return {}
        return {(self.number, item): m.Limit(high=strongest, name=self.named("torque"))}

    def thresholds(self, torque: str, strongest: int) -> list[m.Threshold]:
        """Heat: a warning, half the torque, no torque.  Voltage: a warning."""
        warn, reduce, release = self.limits.temperature
        low, high = self.limits.voltage
        hot, volts = "present_temperature", "present_voltage"
        half, full, off = ((torque, strongest // 2),), ((torque, strongest),), (("torque_enable", 0),)
        name, voltage = self.named("temperature"), self.named("voltage")
        rows = [
            m.Threshold(self.number, hot, warn, f"{name} (warn)", hysteresis=COOLER),
            m.Threshold(self.number, hot, reduce, f"{name} (reduce)", True, COOLER, half, full),
            m.Threshold(self.number, hot, release, f"{name} (release)", True, COOLER, off, holds=True),
            m.Threshold(self.number, volts, low * _TENTHS, voltage, above=False, hysteresis=BETTER),
            m.Threshold(self.number, volts, high * _TENTHS, voltage, hysteresis=BETTER),
        ]
        return [row for row in rows if math.isfinite(row.level)]
