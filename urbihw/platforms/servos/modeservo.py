"""Servos whose mode is selected while the torque is off: the X series and its kin, XL-320, P, PRO, and Feetech.

``goalCurrent`` and ``goalPwm`` drive the servo in the modes "current" and "pwm"; in the others they limit it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

from urbihw.buses.messages import Reply
from urbihw.buses.servos import units
from urbihw.buses.servos.alarms import advised
from urbihw.buses.servos.device import DeviceInfo
from urbihw.buses.servos.item import Mode
from urbihw.buses.servos.item import ShaftMotion as ModeMotion
from urbihw.buses.servos.status import state_words
from urbihw.buses.servos.stop import PRESENT_POSITION
from urbihw.kernel.uobject import Effector, Motion, Origin, function, number, set_range
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.servos import slots
from urbihw.platforms.servos.devices import Refused
from urbihw.platforms.servos.frame import JointFrame
from urbihw.platforms.servos.motors import ServoMotor, Step, makes_wheel

_REBOOT_S = 1.0
"""Seconds to wait for the restart of a servo; it takes about 0.3."""
_EFFORTS: Final = ("goalCurrent", "goalPwm")
_BOUNDS: Final = {"goal_current": "current_limit", "goal_pwm": "pwm_limit"}
"""Registers of efforts -> the registers that bound them, in families where an effort is a limit in other modes."""
_HIDDEN: Final = {"hardware_error": slots.SLOW, "velocity_limit": slots.RARE, "current_limit": slots.RARE}
_JOINT_SPEEDS: Final = ("profile_velocity", "moving_speed", "goal_speed", "goal_velocity")
_LIMITS: Final = (("min_position_limit", "max_position_limit"), ("cw_angle_limit", "ccw_angle_limit"))


class ModeServo(ServoMotor):
    """A servo whose operating mode is a register; mode and limits can be written while the torque is off only."""

    def init(  # type: ignore[override]
        self, channel: DeviceChannel, info: DeviceInfo, refused: Refused, motion: Motion, frame: JointFrame
    ) -> None:
        """Choose its registers: families differ in their names."""
        table = self.table_for(info)
        self.limits = next(pair for pair in _LIMITS if pair[0] in table.items)
        hidden = {name: slots.RARE for name in table.mode_items if name not in self.limits}
        hidden |= {name: pace for name, pace in _HIDDEN.items() if name in table.items}
        self.hidden = tuple(hidden.items())
        self._effort_guards: dict[str, Effector] = {}
        # Drives in one mode, limits in others.
        self._dual_items = {mode.effector for mode in table.modes if mode.motion is ModeMotion.RATE}
        super().init(channel, info, refused, motion, frame)

    def prepare(self) -> None:
        """Watch the hardware error register, and bind the slots of the efforts; the torque limit is unsigned."""
        super().prepare()
        self._state = 0
        self.on_change("hardware_error", self._show_hardware_error)
        limit = self.variables.get("torqueLimit")
        if limit is not None:
            set_range(limit, 0.0, self.facts.stall_torque)
        for slot in _EFFORTS:
            row = self.find_row(slot)
            if row is not None:
                self._bind_effort(row)

    def _mode_where(self, fits: Callable[[Mode], bool]) -> Mode | None:
        return next((mode for mode in self.table.modes if fits(mode)), None)

    # ---------------------------------------------------------------- speed

    def speed_range(self, wheel: bool) -> tuple[float, float]:
        """Up to its velocity limit, if it has one."""
        item = self.table.items.get("velocity_limit")
        if item is not None:
            fastest = units.to_si(item, self.raw.get(item.name, item.default or item.high))
        else:
            fastest = self._largest_speed(wheel)
        return (-fastest if wheel else 0.0), fastest

    def _largest_speed(self, wheel: bool) -> float:
        item = self.table.items.get(self._speed_item(wheel))
        if item is None:
            return math.inf
        if wheel:
            return units.limits_si(item, True)[1] * self.wheel_unit(item)
        bounds = (units.to_si(item, raw) for raw in (item.high, max(item.low, 1)))
        return max(abs(value) for value in bounds if math.isfinite(value))

    def _speed_item(self, wheel: bool) -> str:
        mode = self._mode_where(makes_wheel)
        if wheel and mode is not None:
            return mode.effector
        return next((name for name in _JOINT_SPEEDS if name in self.table.items), "")

    def speed_target(self, value: float, wheel: bool) -> Step:
        """The goal velocity of a wheel, the profile velocity of a joint."""
        item = self.table.item(self._speed_item(wheel))
        if not wheel:
            return item.name, units.from_si(item, value)
        return item.name, units.from_si(item, value * self.frame.direction / self.wheel_unit(item), True)

    @property
    def joint_speed_item(self) -> str:
        return self._speed_item(False)

    def speed_of(self, raw: int) -> float:
        """The inverse of ``speed_target`` of a wheel."""
        item = self.table.item(self._speed_item(True))
        return units.to_si(item, raw, True) * self.wheel_unit(item) * self.frame.direction

    # ---------------------------------------------------------------- modes

    def plan_on(self) -> list[Step]:
        """Torque on, without an old goal: an X servo itself sets its goal position to the present position."""
        return [*self._rest_steps(self.mode_read), ("torque_enable", 1)]

    def _rest_steps(self, mode: Mode | None) -> list[Step]:
        """The write that leaves the servo at rest in a mode."""
        if mode is None or "profile_velocity" in self.table.items and mode.motion is ModeMotion.POSITION:
            return []
        return [(mode.effector, 0 if mode.motion is ModeMotion.RATE else PRESENT_POSITION)]

    def plan_mode(self, mode: Mode) -> list[Step]:
        return self._plan(mode, {})

    def plan_limits(self, wheel: bool, least: float, most: float) -> list[Step]:
        """A wheel or a joint with these limits; modes with a goal position and no limits of it keep their mode."""
        if wheel:
            mode = self._mode_where(makes_wheel)
            return [] if mode is None else self._plan(mode, {})
        limited = self.mode_read if self.takes_positions else self._mode_where(lambda mode: bool(mode.limits))
        return self._plan(limited, self.joint.counts_of_limits(self.limits, least, most))

    def _plan(self, mode: Mode | None, limits: Mapping[str, int]) -> list[Step]:
        """Torque off, limits, mode, effector at rest, what drove it as a setting again, torque on if it was on.

        After power on the goals of current and PWM are their limits, with which the servo would run away.
        """
        values = {**({} if mode is None else dict(mode.when)), **limits}
        if mode is not None and self.table.mode_of({**self.raw, **values}) is not mode:
            # Limits of 0 select another mode.
            values |= {name: (self.table.item(name).low, self.table.item(name).high)[at] or 1
                       for at, name in enumerate(self.limits)}  # fmt: skip
        steps: list[Step] = [(item, raw) for item, raw in values.items() if self.raw.get(item) != raw]
        if steps and mode is not None and mode is not self.mode_read:
            left = "" if self.mode_read is None else self.mode_read.effector
            if left in self._dual_items and left != mode.effector:
                steps.append((left, self.settings.get(left, self._unlimited(left))))
            steps += self._rest_steps(mode)
        return self._with_torque_off(steps)

    def _unlimited(self, item: str) -> int:
        """Return the count of a register that drives the servo in one mode, and in the others limits nothing."""
        bound = _BOUNDS.get(item, "")
        return self.raw.get(bound, self.table.item(item).high) if bound in self.table.items else 0

    def _with_torque_off(self, steps: list[Step]) -> list[Step]:
        if not steps:
            return []
        # A goal of this round may be about to switch it on, so that what was read last does not count.
        on = [] if self.raw.get("torque_enable") == 0 else [("torque_enable", 1)]
        return [("torque_enable", 0), *steps, *on]

    # ---------------------------------------------------------------- efforts

    def _bind_effort(self, row: slots.RegisterSlot) -> None:
        var = self.variables[row.name]
        self._effort_guards[row.name] = self.guard(self.motion, self.number, var)
        self.notify_change(var, partial(self._accept_effort, row.name))
        item = self.table.item(row.item)
        set_range(var, *units.limits_si(item))
        bound = _BOUNDS.get(row.item, "")

        def show_bound(raw: int, stamp: float) -> None:
            most = units.to_si(item, raw)
            set_range(var, -most, most)

        if bound in self.table.items:
            self.on_change(bound, show_bound)

    def _accept_effort(self, slot: str) -> None:
        self._write_effort(slot, self._effort_guards[slot].origin)

    def _write_effort(self, slot: str, origin: Origin) -> None:
        row = self.find_row(slot)
        assert row is not None, "bound for a row only"
        raw = self.raw_of(row, number(self.variables[slot]))
        if not self.is_off:
            self.show_wanted(row.item, raw)
        if self.switching:
            self.defer_write(slot, origin)
        elif not self._drives(row.item):
            if _BOUNDS.get(row.item) not in self.table.items:
                raise ValueError(f"it is for the mode {row.name.removeprefix('goal').lower()}: set mode first")
            self.settings[row.item] = raw
            self.channel.set_target(self.number, row.item, raw, origin)
        elif not self.is_off:
            if self.raw.get("torque_enable") != 1:
                # Its goal must be 0 before the torque is on: after power on it is the limit.
                self.defer_write(slot, origin)
                self.write_steps(self.plan_on(), slot)
                return
            self.channel.set_target(self.number, row.item, raw, origin)

    def _drives(self, item: str) -> bool:
        return self.mode_read is not None and self.mode_read.effector == item

    def effector_writers(self) -> dict[str, Callable[[Origin], None]]:
        return super().effector_writers() | {slot: partial(self._write_effort, slot) for slot in self._effort_guards}

    def restorable_settings(self) -> dict[str, int]:
        """Leave out what may drive it: in which mode it is must be read first."""
        return {item: raw for item, raw in self.settings.items() if item not in self._dual_items}

    def on_all_read(self) -> None:
        """Restore what does not drive it in the mode that has just been read."""
        super().on_all_read()
        self.restore_refused()

    def restore_refused(self) -> None:
        for item, raw in list(self.settings.items()):
            if item in self._dual_items and self.mode_read is not None and not self._drives(item):
                self.set_setting(item, raw)

    def set_setting(self, item: str, raw: int) -> None:
        """An effort carries an origin: the servo keeps it, and in another mode it would drive the servo."""
        if item not in self._dual_items:
            super().set_setting(item, raw)
            return
        self.settings[item] = raw
        self.channel.set_target(self.number, item, raw, self.motion.origin())

    def write_setting(self, row: slots.RegisterSlot, raw: int) -> None:
        """Refuse the torque limit in the mode "pwm", where its register drives the servo."""
        if row.name == "torqueLimit" and self._drives(row.item):
            raise ValueError(f"in this mode it drives the servo: write goalPwm of motor{self.number}")
        if row.item in self._dual_items:
            self.motion.check()
            self.motion.check_device(self.number)
        super().write_setting(row, raw)

    # ---------------------------------------------------------------- alarms

    def explain_error(self, error: str) -> str:
        """Add the advice after an alarm, and for EEPROM registers, which are only written while the torque is off."""
        alarm = self.explain_alarm()
        if alarm:
            return alarm
        if "access" in error and self.raw.get("torque_enable"):
            return f"{error}; switch the motor off first: motor{self.number}.load = 0"
        return error

    def explain_alarm(self) -> str:
        """Return the advice after an alarm: only a restart brings the torque back, of a Feetech servo a new write."""
        words = self.alarm.sensed
        if self.raw.get("hardware_error"):
            return f"motor {self.number} gives no torque: {advised(words, f'motor{self.number}.reboot')}"
        if not self._state & self.raw.get("shutdown", self._state) or "hardware_error" in self.table.items:
            return ""
        return f"motor {self.number} gives little or no torque: {advised(words, f'motor{self.number}.load = 1')}"

    def on_state_bits(self, raw: int, stamp: float) -> None:
        """Servos without a register of hardware errors tell in each answer what is wrong."""
        self._state = raw
        if "hardware_error" not in self.table.items:
            self.show_alarm(state_words(raw, self.protocol))

    @function
    def reboot(self) -> None:
        """Restart the servo, the only way to get its torque back after an alarm; it goes limp."""
        self.channel.send_request("reboot", self.number, self._handle_reboot)

    def _handle_reboot(self, reply: Reply) -> None:
        if not reply.ok:
            self.refused("reboot", reply.error)
            return
        handle = 0

        def started() -> None:
            self.remove_timer(handle)
            self.restore()

        # Its RAM is reset as after power on: restore the settings when it has started.
        handle = self.set_timer(_REBOOT_S, started)

    def _show_hardware_error(self, raw: int, stamp: float) -> None:
        self.show_alarm(self.table.error_words(raw))
