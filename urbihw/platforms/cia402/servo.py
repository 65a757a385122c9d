"""The class ServoDrive: a drive as a motor in radians.

``positionCoeff`` is rad per increment of the motor's own shaft, from the encoder resolution of the drive (0x608F). With
a gear, or a drive that counts in other units, set it and ``velocityCoeff`` (rad/s per unit of the drive). Torques are
those of the motor, in N m, from its rated torque (0x6076).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from urbihw.buses import messages as m
from urbihw.buses.can import cia402 as c
from urbihw.buses.can.drive import DriveInfo
from urbihw.buses.can.emergencies import advised, emergency_text
from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import (
    Effector,
    EffectorDevice,
    Motion,
    Origin,
    UVar,
    event,
    function,
    number,
    owned,
    reading,
    set_range,
    variable,
)
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.cia402 import words
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.hooks import LimitNamer, LimitTable
from urbihw.platforms.limits import DeviceLimits, whole_counts

_THOUSAND = 1000.0
_LARGEST_TORQUE = (1 << 15) - 1
_HOMING_METHODS = -(1 << 7), (1 << 7) - 1
Refused = Callable[["ServoDrive", str, str, Origin], None]
"""Called for a write that a drive did not execute: drive, slot, reason, writer."""


class ServoDrive(EffectorDevice):
    """A drive.  ``load`` is its power, 0 when off.  Only a write to ``load`` switches it on, at standstill."""

    slot_words = words.DRIVE

    off_is_error = True
    log: DeviceLog
    """Set by the robot."""

    val = owned(math.nan)
    speed = owned(math.nan)
    load = owned(0.0)
    torque = owned(math.nan)
    positionCoeff = variable(1.0)
    velocityCoeff = variable(1.0)

    node = reading()
    modelName = reading("")
    increments = reading(math.nan)
    watched = reading(False)
    state = reading("ok")
    driveState = reading("")
    mode = reading("")
    stale = reading(True)
    fault = reading("")
    faulted = event()
    emergency = event()
    homed = event()
    lost = event()
    back = event()

    fault_changed: Callable[[], None] = staticmethod(lambda: None)
    """Called when ``fault`` has changed; set by the robot."""

    def init(self, channel: DeviceChannel, info: DriveInfo, refused: Refused, motion: Motion) -> None:
        """Show the drive that ``info`` describes; ``motion`` decides who may move it."""
        self.number = info.id
        self._channel = channel
        self._info = info
        self._report_refused = refused
        self._raw: Mapping[str, int] = {}
        self._code = 0
        for var, value in (
            (self.node, float(info.id)),
            (self.modelName, info.name),
            (self.increments, info.increments),
            (self.watched, info.watches),
        ):
            var.sense(value)
        self._torque_coefficient = info.rated_torque / _THOUSAND
        self._limits = DeviceLimits()
        self._own_coefficient = 1.0
        if math.isfinite(info.increments) and info.increments > 0:
            self._own_coefficient = math.tau / info.increments
            self.positionCoeff.sense(math.tau / info.increments)
            self.velocityCoeff.sense(math.tau / info.increments)
        self._set_ranges()
        self._motion = motion
        val, speed, torque = (self.guard(motion, self.number, var) for var in (self.val, self.speed, self.torque))
        for guard, var, item, unit in (
            (val, self.val, "position", self.positionCoeff),
            (speed, self.speed, "velocity", self.velocityCoeff),
        ):
            self.notify_change(var, partial(self._write_in_units, guard, var, item, unit))
        self.notify_change(self.torque, lambda: self._write_torque(torque))
        self.notify_change(self.load, self._switch_power)
        for coefficient in (self.positionCoeff, self.velocityCoeff):
            self.notify_change(coefficient, self._check_coefficient)

    # ---------------------------------------------------------------- what urbiscript calls

    @function("resetFault")
    def reset_fault(self) -> None:
        """Acknowledge a fault; the drive is off afterwards."""
        self._send_request("reset", "resetFault")

    @function("quickStop")
    def quick_stop(self) -> None:
        """Brake as hard as the drive can, then off."""
        self._send_request("quick_stop", "quickStop")

    @function
    def home(self, method: int) -> None:
        """Look for the home position by a method of the profile (0x6098), which moves the drive; event ``homed``."""
        least, most = _HOMING_METHODS
        if not least <= method <= most:
            raise ValueError(f"a homing method (0x6098) is a number from {least} to {most}, not {method}")
        if off := self.explain_off():
            raise ValueError(off)
        # Admitted as a write is, so that the homing ends with the connection of its client.
        origin = self._motion.admit(self.number)

        def done(reply: Reply) -> None:
            if reply.ok:
                self.homed.emit()
            else:
                self._report_refused(self, "home", reply.error, origin)

        self._channel.send_request("home", self.number, done, origin, method)

    # ---------------------------------------------------------------- written

    def _write_target(
        self, guard: Effector, var: UVar, item: str, coefficient: float, most: int = (1 << 31) - 1
    ) -> None:
        value = number(var)
        if off := self.explain_off():
            raise ValueError(off)
        raw = max(-most, min(most, round(value / coefficient)))
        self._channel.set_target(self.number, item, raw, guard.origin, 1 / coefficient)

    def _write_in_units(self, guard: Effector, var: UVar, item: str, coefficient: UVar) -> None:
        self._write_target(guard, var, item, coefficient.value)

    def _write_torque(self, guard: Effector) -> None:
        if math.isnan(self._torque_coefficient):
            raise ValueError(f"drive {self.number} has no torque mode, or does not tell its rated torque (0x6076)")
        if not all(map(math.isinf, (*self._limits.position, self._limits.speed))):
            raise ValueError(f"drive {self.number} has a limit of position or speed, which a torque would not keep")
        self._write_target(guard, self.torque, "torque", self._torque_coefficient, _LARGEST_TORQUE)

    def explain_off(self) -> str:
        """Return why a write does not move the drive, "" if it does."""
        if self.state.sensed != "ok" or self.driveState.sensed == c.ENABLED:
            return ""
        if self.fault.sensed:
            return f"drive {self.number} is in fault: {advised(self.fault.sensed, self.number)}"
        return f"drive {self.number} is off ({self.driveState.sensed}): switch it on with load = 1"

    def _switch_power(self) -> None:
        on = bool(number(self.load))
        if on:
            self._motion.check_device(self.number)
        self._send_request("enable" if on else "disable", "load")

    def _send_request(self, verb: str, slot: str) -> None:
        origin = self._motion.origin()

        def done(reply: Reply) -> None:
            if not reply.ok:
                self._report_refused(self, slot, reply.error, origin)

        self._channel.send_request(verb, self.number, done, origin)

    def _check_coefficient(self, coefficient: UVar) -> None:
        if number(coefficient) == 0:
            raise ValueError("a coefficient is a number other than 0: SI units per unit of the drive")
        self._set_ranges()
        self._show_values(None)

    def _set_ranges(self) -> None:
        """Set the ranges of the slots from the drive's own limits, in SI; a negative coefficient swaps them."""
        ends = sorted((self._info.low * self.positionCoeff.value, self._info.high * self.positionCoeff.value))
        fastest = self._info.most_speed * abs(self.velocityCoeff.value)
        strongest = _LARGEST_TORQUE * self._torque_coefficient
        for var, (least, most) in (
            (self.val, ends),
            (self.speed, (-fastest, fastest)),
            *([] if math.isnan(strongest) else [(self.torque, (-strongest, strongest))]),
        ):
            set_range(var, least, most)

    # ---------------------------------------------------------------- limits of the settings

    def limits_in_counts(self, limits: DeviceLimits, named: LimitNamer) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """Convert rad, rad/s, rad/s2 of the motor's own shaft to increments: see ``platforms.hooks.LimitedDevice``.

        Programs may change the coefficients; the limits do not change with them.
        """
        self._limits = limits
        place = speed = 1 / self._own_coefficient
        places = whole_counts(*(value * place for value in limits.position))
        speeds = whole_counts(-limits.speed * speed, limits.speed * speed)
        table = {
            (self.number, "position"): m.Limit(*places, limits.speed * place, named("position")),
            (self.number, "velocity"): m.Limit(*speeds, limits.acceleration * speed, named("speed")),
        }
        if math.isfinite(limits.torque) and not math.isnan(self._torque_coefficient):
            torques = whole_counts(*(value / self._torque_coefficient for value in (-limits.torque, limits.torque)))
            table[self.number, "torque"] = m.Limit(*torques, name=named("torque"))
        return table, ()

    def was_limited(self, message: m.Limited) -> None:
        """Show the limited target in the slot that was written."""
        if message.device == self.number:
            coefficients = {
                "position": self.positionCoeff.value,
                "velocity": self.velocityCoeff.value,
                "torque": self._torque_coefficient,
            }
            self.limit_applied(message.applied * coefficients[message.item], message.limit)

    # ---------------------------------------------------------------- read

    def update_values(self, raw: Mapping[str, int], stamp: float) -> None:
        """Update the slots from measured values in the drive's units."""
        self._raw = raw
        self._show_values(stamp)
        self.stale.sense(False)

    def _show_values(self, stamp: float | None) -> None:
        raw = self._raw
        if not raw:
            return
        self.val.sense(raw["position"] * self.positionCoeff.value, stamp)
        self.speed.sense(raw["velocity"] * self.velocityCoeff.value, stamp)
        if "torque" in raw:
            self.torque.sense(raw["torque"] * self._torque_coefficient, stamp)
        state = c.state_of(raw["status"])
        self.driveState.sense(state)
        self.load.sense(1.0 if state == c.ENABLED else 0.0)
        self.mode.sense(c.MODES.get(raw["mode"], ""))
        self._show_fault(state)

    def _show_fault(self, state: str) -> None:
        faulty = state in (c.FAULT, c.REACTION)
        told = f"code 0x{self._code:04X} ({emergency_text(self._code)})" if self._code else "fault"
        words = told if faulty else ""
        if words == self.fault.sensed:
            return
        fresh = not self.fault.sensed
        self.fault.sense(words)
        self.fault_changed()
        if words and fresh:
            self.log.warning("drive %d: %s", self.number, words)
            self.faulted.emit(words)

    def show_emergency(self, code: int) -> str:
        """Show the code of an emergency message, and return its text; code 0 ends the error (CiA 301, error codes)."""
        self._code = code
        self._show_values(None)
        text = emergency_text(code)
        self.emergency.emit(float(code), text)
        return text

    def changed_state(self, state: str, reason: str) -> None:
        """The drive is ok, lost or back."""
        self.state.sense(state)
        if state == "lost":
            self.stale.sense(True)
            self.load.sense(0.0)
            # Its present speed is unknown; the last place stays, as a stale one.
            self._raw = {}
            self.speed.sense(math.nan)
            self.torque.sense(math.nan)
            self.lost.emit(reason)
        elif state == "back":
            self.back.emit()
