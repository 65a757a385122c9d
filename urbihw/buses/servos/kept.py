"""What was written into the RAM of a servo, and how it is noticed that the servo has forgotten it.

A servo that was without power for a moment answers again as if nothing had been: its speed on the way to a goal, its
acceleration and its torque limit are those of a start, and its torque is off. Some of these registers are read with
the torque, each time that this is read: a value that has changed, and was not written, tells of a start.

A servo of protocol 2.0 resets gains, profile, and the goals of PWM and current when its mode changes (ROBOTIS e-manual,
xl430-w250, "Operating Mode"): that is no start, and they are written again at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from urbihw.buses.servos.item import ControlTable, Mode, is_place
from urbihw.buses.servos.plan import TORQUE

EFFORTS: Final = {
    "torque_limit": "", "position_p_gain": "", "p_gain": "", "goal_pwm": "pwm_limit", "goal_current": "current_limit",
}
"""Registers without which a joint has no force: while one of them is 0, it is as limp as without torque -> the register
that a model must have for it; without that, the register counts in another mode only."""
PROFILE: Final = "profile_velocity"
"""The speed at which a servo leads its own goal to the one that it is given."""
OWN_SPEEDS: Final = (PROFILE, "moving_speed", "goal_speed")
"""Registers of the speed of a joint on its way to a goal; a model has one of them."""
_NOT_KEPT: Final = {TORQUE, "goal_position", "bus_watchdog", "lock"}
"""Registers that nothing writes again by itself."""
_BOUNDS: Final = (*OWN_SPEEDS, "goal_velocity", "profile_acceleration", "goal_acceleration", "acceleration", *EFFORTS)
"""Registers that bound a motion: those of them that were written are witnesses."""


class KeptRegisters:
    """The registers of one servo that were written, and their readings.

    Attributes:
        witnesses: those that are to be read with the torque.
        is_unread: one of them was written, and not read since.
    """

    def __init__(self) -> None:
        self.witnesses: tuple[str, ...] = ()
        self.is_unread = False
        self._written: dict[str, int] = {}
        self._read: dict[str, int] = {}

    def record(self, table: ControlTable, mode: Mode | None, values: Mapping[str, int]) -> None:
        """Record what was written: not the torque, nor what moves the shaft in this mode, which a stop decides."""
        for name, raw in values.items():
            if name in _NOT_KEPT or is_place(name) or table.item(name).area == "E":
                continue
            if _moves(mode, name):
                self._written.pop(name, None)
            else:
                self._written[name] = raw
            self._read.pop(name, None)
            self.is_unread = self.is_unread or name in _BOUNDS
        self._choose_witnesses(mode)

    def has_lost(self, values: Mapping[str, int]) -> bool:
        """Take a reading; return whether one of the witnesses has changed, and was not written.

        An alarm takes the force away by itself: an effort of 0 tells nothing.
        """
        lost = False
        for name in self.witnesses:
            raw = values.get(name)
            if raw is None or (not raw and name in EFFORTS):
                continue
            lost = lost or raw not in (self._read.setdefault(name, raw), self._written[name])
        self.is_unread = self.is_unread and not all(name in values for name in self.witnesses)
        return lost

    def given_back(self, mode: Mode | None) -> dict[str, int]:
        """Return what is to be written again in this mode, after a start or a change of the mode; it counts as not read
        yet."""
        self._read.clear()
        self._choose_witnesses(mode)
        self.is_unread = bool(self.witnesses)
        return {name: raw for name, raw in self._written.items() if not _moves(mode, name)}

    def _choose_witnesses(self, mode: Mode | None) -> None:
        self.witnesses = tuple(name for name in _BOUNDS if name in self._written and not _moves(mode, name))


def _moves(mode: Mode | None, name: str) -> bool:
    """Return whether a register moves the shaft in a mode; in an unknown one all goals may."""
    if mode is None:
        return name.startswith("goal_") or name in OWN_SPEEDS
    return name == mode.effector
