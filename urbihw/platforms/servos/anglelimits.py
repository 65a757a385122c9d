"""Servos of protocol 1.0, whose angle limits select the mode: AX, RX, EX, MX (1.0)."""

from __future__ import annotations

from typing import Final

from urbihw.buses.servos import units
from urbihw.buses.servos.alarms import NO_TORQUE_LIMIT, advised
from urbihw.buses.servos.item import Mode
from urbihw.buses.servos.status import state_words
from urbihw.buses.servos.stop import PRESENT_POSITION
from urbihw.kernel.uobject import UVar
from urbihw.platforms.servos.motors import ServoMotor, Step, makes_wheel
from urbihw.platforms.servos.slots import ChangeHandler, RegisterSlot

_SLOWEST: Final = 1
"""Counts of moving_speed: 0.1 rpm of a joint, 0.1 % of the drive of a wheel."""


class AngleLimitServo(ServoMotor):
    """A servo whose angle limits, both 0, make it a wheel."""

    limits = ("cw_angle_limit", "ccw_angle_limit")

    def prepare(self) -> None:
        """Also watch the torque limit, which an alarm sets to 0."""
        super().prepare()
        self.on_change("torque_limit", lambda raw, stamp: self.update_load(stamp))

    def update_load(self, stamp: float) -> None:
        """The motor is on with torque enable 1 and a torque limit other than 0, to which an alarm sets it."""
        on = self.raw.get("torque_enable") == 1 and self.raw.get("torque_limit") != 0
        self.load.sense(float(on), stamp)
        self.update_state()

    def explain_alarm(self) -> str:
        """Return the advice for a torque limit of 0, which an alarm has set."""
        if self.raw.get("torque_limit") != 0:
            return ""
        words = self.alarm.sensed or NO_TORQUE_LIMIT
        return f"motor {self.number} gives no torque: {advised(words, f'motor{self.number}.load = 1')}"

    def restorable_settings(self) -> dict[str, int]:
        """Leave the speed out for a wheel: the speed that was set for a joint would drive it."""
        wheel = bool(self.wheel.sensed)
        return {item: raw for item, raw in self.settings.items() if not (wheel and item == "moving_speed")}

    def plan_on(self) -> list[Step]:
        """Goal to the present position (an old goal must not move it), torque limit after an alarm, torque on."""
        steps: list[Step] = []
        if not self.wheel.sensed:
            steps.append((self.goal, PRESENT_POSITION))
        if self.raw.get("torque_limit") == 0:
            steps.append(("torque_limit", self.settings.get("torque_limit", self.raw.get("max_torque", 1023))))
        return [*steps, ("torque_enable", 1)]

    def speed_range(self, wheel: bool) -> tuple[float, float]:
        """A wheel turns both ways up to its no-load speed; a joint from 0 up to the register's largest value."""
        if wheel:
            item = self.table.item("moving_speed")
            fastest = units.limits_si(item, True)[1] * self.wheel_unit(item)
            return -fastest, fastest
        return 0.0, units.limits_si(self.table.item("present_speed"))[1]

    def speed_target(self, value: float, wheel: bool) -> Step:
        """The wheel of an AX is driven open loop: a share of full drive, taken to give that share of full speed."""
        item = self.table.item("moving_speed")
        if not wheel:
            return item.name, units.from_si(item, value)
        return item.name, units.from_si(item, value * self.frame.direction / self.wheel_unit(item), True)

    @property
    def joint_speed_item(self) -> str:
        return "moving_speed"

    def speed_of(self, raw: int) -> float:
        """The inverse of ``speed_target``."""
        item = self.table.item("moving_speed")
        return units.to_si(item, raw, True) * self.wheel_unit(item) * self.frame.direction

    def speed_handler(self, row: RegisterSlot, var: UVar) -> ChangeHandler:
        """The present speed of the wheel of an AX is a share of full drive, too."""
        item, direction = self.table.item(row.item), self.frame.direction
        full = self.wheel_unit(item)

        def show_speed(raw: int, stamp: float) -> None:
            if self.wheel.sensed:
                var.sense(units.to_si(item, raw, wheel=True) * full * direction, stamp)
            else:
                var.sense(units.to_si(item, raw) * direction, stamp)

        return show_speed

    def plan_mode(self, mode: Mode) -> list[Step]:
        """A joint has its full range; other modes are selected by certain values of both limits."""
        others = {item: 0 for item in self.table.mode_items if item not in self.limits}
        cw, ccw = self.limits
        if not mode.when:
            others |= {cw: self.table.item(cw).low, ccw: self._full_range()}
        return self._plan(others | dict(mode.when), makes_wheel(mode))

    def _full_range(self) -> int:
        """Return the greatest count of a joint: the position register of a model with several turns has more."""
        turns = [raw for mode in self.table.modes for item, raw in mode.when if raw and item in self.limits]
        return min([self.table.item(self.limits[1]).high, *(raw - 1 for raw in turns)])

    def plan_limits(self, wheel: bool, least: float, most: float) -> list[Step]:
        """Both limits 0 make it a wheel; limits of a joint differ from that."""
        cw, ccw = self.limits
        if wheel:
            return self._plan({cw: 0, ccw: 0}, True)
        values = self.joint.counts_of_limits(self.limits, least, most)
        values[ccw] = max(values[ccw], 1)
        return self._plan(values, False)

    def _plan(self, values: dict[str, int], wheel: bool) -> list[Step]:
        """Write the speed first: that of a joint would drive the wheel, and that of a wheel is invalid for a joint.

        Between the writes, and if the servo stops answering among them, it has the smallest speed: a wheel does not
        turn with it, and a joint hardly moves; 0 would be full speed for a joint.
        """
        steps: list[Step] = [(item, raw) for item, raw in values.items() if self.raw.get(item) != raw]
        if wheel == self.wheel.sensed or not steps:
            return steps
        if wheel:
            return [("moving_speed", _SLOWEST), *steps, ("moving_speed", 0)]
        # Without a new goal it would go to the one that it had before it was a wheel.
        held: list[Step] = [(self.goal, PRESENT_POSITION)] if self.raw.get("torque_enable") == 1 else []
        return [("moving_speed", _SLOWEST), *steps, *held, ("moving_speed", self.settings.get("moving_speed", 0))]

    def on_state_bits(self, raw: int, stamp: float) -> None:
        """The error bits say what is wrong."""
        self.show_alarm(state_words(raw, self.protocol))
