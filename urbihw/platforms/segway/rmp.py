"""The class RMP of the manual: speeds, coders and coefficients of a base, with its modes, torques and faults.

Samples and commands are raw counts; slots are in SI units.  The coefficients (SI units per count) convert them;
``usegway.u`` sets them for the model.  Those of the manual apply to measured values.  ``velocityCoeff`` and
``turnCoeff`` apply to commands, because the firmware counts these two differently (README.md, "Quirks").

A value that the base no longer reports is ``nan``, or "" for a word; ``missing`` names the missing frames.

A base may have several RMPs: each shows all values, and the last command of any of them applies.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, Protocol

from urbihw.buses import messages as m
from urbihw.kernel.uobject import (
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
from urbihw.navigation.frames import ORIGIN, moved
from urbihw.navigation.pilot import Pilot
from urbihw.platforms.hooks import LimitNamer, LimitTable
from urbihw.platforms.limits import DeviceLimits, whole_counts
from urbihw.platforms.segway import protocol as p
from urbihw.platforms.segway import words as meanings
from urbihw.platforms.segway.monitor import missing_words, status_missing

BASE: Final = "base"
PER_RADIAN: Final = 446.9071
"""Counts of angles and their rates, 7.8 for a degree, on all models (libsegwayrmp, Orca)."""
FULL_SCALE: Final = 16
FULL_CURRENT: Final = 256
_FULL_SPEED: Final = 3.576
"""m/s at the largest velocity command: 8 mph (README.md, "Quirks")."""
_QUARTERS: Final = 4  # counts of the battery for 1 V
EMPTY, FULL = 60.0, 78.0
"""Volts between which the battery's charge is interpolated; guessed around the nominal 72."""
RECOVERED: Final = 1.0
"""Volts above that at which it counts as charged again: the voltage sags while the base accelerates."""

_EARLY: Final = 0.01
"""Half the shortest time between two samples, in seconds."""

_SCALED: Final = {
    "leftSpeed": "left_speed",
    "rightSpeed": "right_speed",
    "forward": "forward",
    "yaw": "yaw",
    "left": "left",
    "right": "right",
}
"""Slot -> item; the name of the coefficient is that of the slot plus ``Coeff``."""
_WAY: Final = frozenset({"forward", "yaw"})
"""Items that the odometry needs."""
_ANGLES: Final = {"pitch": "pitch", "pitchRate": "pitch_rate", "roll": "roll", "rollRate": "roll_rate"}
_SHARES: Final = {
    "speedScale": ("velocity_scale", FULL_SCALE),
    "accelerationScale": ("acceleration_scale", FULL_SCALE),
    "turnScale": ("turn_scale", FULL_SCALE),
    "currentLimit": ("current_limit", FULL_CURRENT),
}
"""Slot with the range 0..1 -> (configuration, parameter for 1)."""
_OFF: Final = (p.MODES[0], p.MODES[3])
_UNKNOWN_FAULT: Final = "not known: the base does not send its status"
"""The modes in which the base does not execute speeds."""
_NAMED: Final = {"mode": p.MODES, "gain": p.GAINS}


class RmpBase(Protocol):
    """The part of the robot that an RMP uses."""

    settings: dict[str, int]
    """Configurations as last sent."""

    motion: Motion
    """The authority over motion."""

    def set_target(self, item: str, counts: int, origin: Origin) -> None:
        """Send a speed with the next command."""
        ...

    def end_path(self) -> None:
        """End the planner's path, because a program is about to write a speed."""
        ...

    def send_configuration(self, slot: str, name: str, parameter: int) -> None:
        """Send a configuration command to the base."""
        ...


class RMP(EffectorDevice):
    """A base with its coefficients; a base may have several RMPs."""

    slot_words = meanings.RMP

    forwardSpeed = owned(0.0)
    yawSpeed = owned(0.0)
    leftSpeed = reading(0.0)
    rightSpeed = reading(0.0)
    forward = reading(0.0)
    yaw = reading(0.0)
    left = reading(0.0)
    right = reading(0.0)

    forwardSpeedCoeff = variable(1.0)
    yawSpeedCoeff = variable(1.0)
    leftSpeedCoeff = variable(1.0)
    rightSpeedCoeff = variable(1.0)
    forwardCoeff = variable(1.0)
    yawCoeff = variable(1.0)
    leftCoeff = variable(1.0)
    rightCoeff = variable(1.0)
    velocityCoeff = variable(1.0)
    turnCoeff = variable(1.0)
    torqueCoeff = variable(1.0)

    lowVoltage = variable(p.LOW_VOLTAGE)
    batteryLow = event()

    period = reading(0.05)
    state = reading("ok")
    stale = reading(True)
    pitch = reading(math.nan)
    pitchRate = reading(math.nan)
    roll = reading(math.nan)
    rollRate = reading(math.nan)
    leftTorque = reading(math.nan)
    rightTorque = reading(math.nan)
    voltage = reading(math.nan)
    boxVoltage = reading(math.nan)
    remain = reading(math.nan)
    motors = reading(False)
    fault = reading("")
    missing = reading("")
    mode = owned("")
    gain = owned("")
    speedScale = owned(1.0)
    accelerationScale = owned(1.0)
    turnScale = owned(1.0)
    currentLimit = owned(1.0)
    lockout = owned(False)
    faulted = event()

    def attach(self, base: RmpBase, period: float) -> None:
        """Join a base and show it every ``period`` seconds; called once, by ``init`` in ``usegway.u``."""
        self._base = base
        self.period.sense(period)
        self._due = -math.inf
        self._raw: Mapping[str, int] = {}
        self._place = ORIGIN
        self._last: tuple[int, float, float] | None = None
        self._battery_is_low = False
        for var, item, coefficient in (
            (self.forwardSpeed, "velocity", self.velocityCoeff),
            (self.yawSpeed, "turn", self.turnCoeff),
        ):
            self.notify_change(var, self._drive(var, item, coefficient))
        for name, coefficient in self.variables.items():
            if name.endswith("Coeff"):
                self.notify_change(coefficient, self._check)
        for name, (item, full) in _SHARES.items():
            var = self.variables[name]
            set_range(var, 0.0, 1.0)
            self.notify_change(var, self._share(var, item, full))
        for name, words in _NAMED.items():
            self.notify_change(self.variables[name], self._name(self.variables[name], words))
        self.notify_change(
            self.lockout, lambda: base.send_configuration("lockout", "lockout", int(bool(number(self.lockout))))
        )
        self.configured()

    # ---------------------------------------------------------------- what urbiscript calls

    @function("resetCoders")
    def reset_coders(self) -> None:
        """Reset ``forward``, ``yaw``, ``left`` and ``right`` to 0; takes a quarter of a second."""
        self._base.send_configuration("resetCoders", "reset", p.ALL_INTEGRATORS)

    @function
    def odometry(self) -> list[float]:
        """The pose relative to the first reading: x and y in m, heading in rad, counter-clockwise.

        Raises ValueError while the base does not report it, so that a movement over a distance ends.
        """
        self.check_way()
        return list(self._place)

    # ---------------------------------------------------------------- what the planner asks

    pilot: Pilot | None = None
    """Gets each distance if the planner uses this RMP."""

    def check_way(self) -> None:
        """Raise ValueError while the base does not report its distance."""
        if self._raw and not self._raw.keys() >= _WAY:
            raise ValueError(f"the base does not tell its way: {missing_words(self._raw['missing'])} missing")

    def speeds_in_counts(self, v: float, w: float) -> dict[str, int]:
        """Return the commands, by item, for a speed ahead (m/s) and a turn to the left (rad/s)."""
        return {
            "velocity": self._counts_of(v, "velocity", self.velocityCoeff),
            "turn": self._counts_of(w, "turn", self.turnCoeff),
        }

    def _counts_of(self, value: float, item: str, coefficient: UVar) -> int:
        per_count = coefficient.value * self._scale(item)
        # At scale 0 the base does not move at any command.
        return round(value / per_count) if per_count else 0

    # ---------------------------------------------------------------- written

    def _drive(self, var: UVar, item: str, coefficient: UVar) -> Any:
        guard = self.guard(self._base.motion, BASE, var)

        def write() -> None:
            self._base.end_path()
            self._base.set_target(item, self._counts_of(number(var), item, coefficient), guard.origin)

        return write

    def explain_off(self) -> str:
        """Return why the base does not drive in its present mode or with its present fault, "" if it does."""
        if self.mode.sensed in _OFF:
            mode = f"the base does not drive (mode {self.mode.sensed})"
            return f'{mode}: switch it on with rmp.mode = "tractor" or "balance"'
        fault = self.fault.sensed
        if fault and fault != _UNKNOWN_FAULT and not self.motors.sensed:
            return f"the base does not drive, its motors are off: {fault}"
        return ""

    def _check(self, coefficient: UVar) -> None:
        if number(coefficient) == 0:
            raise ValueError("a coefficient is a number other than 0: SI units per count")
        self.configured()
        self._show()

    def _share(self, var: UVar, item: str, full: int) -> Any:
        return lambda: self._base.send_configuration(var.name, item, round(number(var) * full))

    def _name(self, var: UVar, words: tuple[str, ...]) -> Any:
        def write() -> None:
            if var.value not in words:
                raise ValueError(f"{var.name} is one of {', '.join(words)}, not {var.value!r}")
            self._base.send_configuration(var.name, var.name, words.index(var.value))

        return write

    def _scale(self, item: str) -> float:
        """Return the share of a command that the base executes."""
        return self._base.settings.get(f"{item}_scale", FULL_SCALE) / FULL_SCALE

    def configured(self) -> None:
        """Show the changed configuration of the base, and the ranges that follow from it."""
        settings = self._base.settings
        for name, (item, full) in _SHARES.items():
            self.variables[name].sense(settings.get(item, full) / full)
        self.lockout.sense(bool(settings.get("lockout", 0)))
        for var, item, coefficient, most in (
            (self.forwardSpeed, "velocity", self.velocityCoeff, p.MOST_VELOCITY),
            (self.yawSpeed, "turn", self.turnCoeff, p.MOST_TURN),
        ):
            limit = abs(coefficient.value) * self._scale(item) * most
            set_range(var, -limit, limit)

    # ---------------------------------------------------------------- limits of the settings

    def limits_in_counts(self, limits: DeviceLimits, named: LimitNamer) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """Convert the limits from m/s, rad/s and m/s2, by the full scale of the commands.

        Programs may change coefficients and scales; the limits do not depend on them.
        """
        forward, turn = p.MOST_VELOCITY / _FULL_SPEED, PER_RADIAN
        speeds, turns = (
            whole_counts(-most, most) for most in (limits.speed * forward, limits.turn * turn)
        )
        table = {
            (BASE, "velocity"): m.Limit(*speeds, limits.acceleration * forward, named("speed")),
            (BASE, "turn"): m.Limit(*turns, name=named("turn")),
        }
        low, high = (volts * _QUARTERS for volts in limits.voltage)
        voltage = named("voltage")
        rows = (
            m.Threshold(BASE, "battery", low, voltage, above=False, hysteresis=_QUARTERS),
            m.Threshold(BASE, "battery", high, voltage, hysteresis=_QUARTERS),
        )
        return table, [row for row in rows if math.isfinite(row.level)]

    def was_limited(self, message: m.Limited) -> None:
        """Show the limited speed, by the coefficient of this RMP."""
        coefficient = self.velocityCoeff if message.item == "velocity" else self.turnCoeff
        self.limit_applied(message.applied * coefficient.value * self._scale(message.item), message.limit)

    # ---------------------------------------------------------------- read

    def offer_cycle(self, raw: Mapping[str, int], stamp: float) -> None:
        """Show a cycle if it is time for one."""
        period = float(self.period.sensed)
        # A cycle may be slightly early.
        if stamp < self._due - _EARLY:
            return
        self._due = max(self._due + period, stamp - period)
        self.show_cycle(raw, stamp)

    def show_cycle(self, raw: Mapping[str, int], stamp: float) -> None:
        """Show a cycle, in counts, with its kernel time in s."""
        self._raw = raw
        self._show(stamp)
        self._add_way(raw, stamp)
        self.stale.sense(False)

    def changed_state(self, state: str) -> None:
        """Show the state of the base, "ok" or "lost"."""
        self.state.sense(state)
        if state != "ok":
            self.stale.sense(True)
            self._last = None
            # What was measured last is no speed of a base that stands by itself now, or is out of reach.
            for speed in (self.forwardSpeed, self.yawSpeed, self.leftSpeed, self.rightSpeed):
                speed.sense(math.nan)

    def _show(self, stamp: float | None = None) -> None:
        raw = self._raw
        if not raw:
            return
        coefficient = {name: var.value for name, var in self.variables.items() if name.endswith("Coeff")}
        for name, item in _SCALED.items():
            self.variables[name].sense(raw.get(item, math.nan) * coefficient[f"{name}Coeff"], stamp)
        mean = (raw.get("left_speed", math.nan) + raw.get("right_speed", math.nan)) / 2
        self.forwardSpeed.sense(mean * coefficient["forwardSpeedCoeff"], stamp)
        self.yawSpeed.sense(raw.get("yaw_rate", math.nan) * coefficient["yawSpeedCoeff"], stamp)
        for name, item in _ANGLES.items():
            self.variables[name].sense(raw.get(item, math.nan) / PER_RADIAN, stamp)
        self._show_rest(raw, coefficient["torqueCoeff"], stamp)

    def _show_rest(self, raw: Mapping[str, int], per_torque: float, stamp: float | None) -> None:
        """Show the values that old firmware does not report, or only in part."""
        self.leftTorque.sense(raw.get("left_torque", math.nan) * per_torque, stamp)
        self.rightTorque.sense(raw.get("right_torque", math.nan) * per_torque, stamp)
        volts = raw.get("battery", math.nan) / 4
        self.voltage.sense(volts, stamp)
        self._check_battery(volts)
        share = (volts - EMPTY) / (FULL - EMPTY)
        self.remain.sense(share if math.isnan(share) else min(max(share, 0.0), 1.0), stamp)
        self.boxVoltage.sense(1.4 + 0.0125 * raw.get("box_battery", math.nan), stamp)
        for name, words in _NAMED.items():
            code = raw.get(name, -1)
            known = words[code] if 0 <= code < len(words) else f"unknown {code}"
            self.variables[name].sense(known if name in raw else "", stamp)
        missing = raw["missing"]
        self.missing.sense(missing_words(missing))
        if "status1" in raw:
            self.motors.sense(p.motors_on(raw["status1"]))
            self._show_fault(p.fault_words(raw["status1"], raw["status2"]))
        elif status_missing(missing):
            self.motors.sense(False)
            self._show_fault(_UNKNOWN_FAULT)

    def _check_battery(self, volts: float) -> None:
        """Emit ``batteryLow`` when the voltage falls below ``lowVoltage``."""
        level = float(self.lowVoltage.value)
        if volts < level and not self._battery_is_low:
            self._battery_is_low = True
            self.batteryLow.emit(volts)
        elif volts >= level + RECOVERED:
            self._battery_is_low = False

    def _show_fault(self, words: str) -> None:
        if words != self.fault.sensed:
            self.fault.sense(words)
            if words:
                self.faulted.emit(words)

    def _add_way(self, raw: Mapping[str, int], stamp: float) -> None:
        """Add the distance since the last cycle to the pose, and pass it to the planner."""
        pilot = self.pilot
        if not raw.keys() >= _WAY:
            # The distance of this time is added when the counters are back.
            if pilot is not None:
                pilot.stop_following("the base does not tell its way")
            return
        forward, yaw = self.forward.sensed, self.yaw.sensed
        last, self._last = self._last, (raw["resets"], forward, yaw)
        way = angle = 0.0
        if last is not None and last[0] == raw["resets"]:
            way, angle = forward - last[1], yaw - last[2]
        self._place = moved(self._place, way, angle)
        if pilot is not None:
            pilot.show_way(way, angle, stamp)
