"""The joints of the arm: which servo is which, and the servo of the gripper, which must not burn.

A gripper that holds something stands against its own goal for as long as it holds. LeRobot therefore halves its torque,
and lets its protection act at a quarter of the drive; the same values are used here.
Source: huggingface/lerobot `robots/so_follower/so_follower.py`, `configure`.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from urbihw.buses.messages import Reply
from urbihw.buses.servos import units
from urbihw.kernel.uobject import set_range
from urbihw.platforms.servos import slots
from urbihw.platforms.servos.modeservo import ModeServo

JOINTS: Final = {
    "shoulder_pan": 1,
    "shoulder_lift": 2,
    "elbow_flex": 3,
    "wrist_flex": 4,
    "wrist_roll": 5,
    "gripper": 6,
}
"""The joints by LeRobot's names, and the ids that LeRobot's set-up gives to their servos."""
GRIPPER: Final = "gripper"
GRIPPER_GUARDS: Final = {"max_torque": 500, "protection_current": 250, "overload_torque": 25}
"""Registers of the gripper's EEPROM and their largest values, in counts: 50 %, 1.6 A, 25 %."""
_TORQUE_LIMIT: Final = "torque_limit"


class ArmServo(ModeServo):
    """The servo of a joint."""


class GripperServo(ModeServo):
    """The servo of the gripper, with half the torque, and a protection that acts early."""

    _pending = 0
    """Writes of registers that guard it, not answered yet."""
    _has_told = False

    @property
    def is_complete(self) -> bool:
        """Whether all registers were read, and those that guard it are written: nothing may close it before."""
        return super().is_complete and not self._pending

    def prepare(self) -> None:
        """Watch the registers that guard it, and halve the range of its torque limit."""
        super().prepare()
        shown = {row.item for row in self.rows}
        self.hidden += tuple((item, slots.RARE) for item in GRIPPER_GUARDS if item not in shown)
        for item, most in GRIPPER_GUARDS.items():
            self.on_change(item, partial(self._guard, item, most))
        self.on_change("torque_enable", self._guard_when_off)
        self.on_change(_TORQUE_LIMIT, self._lower_torque)
        half = units.to_si(self.table.item(_TORQUE_LIMIT), GRIPPER_GUARDS["max_torque"])
        set_range(self.variables["torqueLimit"], 0.0, half * self.facts.stall_torque)

    def _lower_torque(self, raw: int, stamp: float) -> None:
        """Lower the torque limit of the RAM at once: the servo takes that of the EEPROM at power-on only."""
        most = GRIPPER_GUARDS["max_torque"]
        if raw > most:
            self.set_setting(_TORQUE_LIMIT, most)

    def _guard(self, item: str, most: int, raw: int, stamp: float) -> None:
        """Write a register of the EEPROM that allows too much; the servo takes it while its torque is off only."""
        if raw <= most:
            return
        if self.raw.get("torque_enable") == 0:
            self._pending += 1
            self.channel.write(self.number, item, most, partial(self._guarded, item))
        elif self.raw.get("torque_enable") and not self._has_told:
            self._has_told = True
            self.log.warning("motor %d: the gripper is not protected from heat yet: switch it off once", self.number)

    def _guard_when_off(self, raw: int, stamp: float) -> None:
        if raw == 0:
            for item, most in GRIPPER_GUARDS.items():
                self._guard(item, most, self.raw.get(item, 0), stamp)

    def _guarded(self, item: str, reply: Reply) -> None:
        self._pending -= 1
        if reply.ok:
            self.raw[item] = GRIPPER_GUARDS[item]
        else:
            self.refused(item, reply.error)
