"""The class RMP of the manual: speeds, coders and coefficients of a base, and what else there is to it.

Raw counts come in with each sample and leave with each command; outside everything is SI, by the coefficients (SI per
count), which ``usegway.u`` sets for the model.  Those of the manual are for what the base measures; ``velocityCoeff``
and ``turnCoeff`` are for what it is told, because firmware counts these two differently (README.md, "Quirks").

What the base does not tell any more is ``nan``, or "" for a word; ``missing`` names the frames that stay out.

Several RMPs may be made of one base: each shows all, and of two that drive it the last one counts.
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
from urbihw.platforms.base import LimitTable, Named
from urbihw.platforms.limits import DeviceLimits, whole_counts
from urbihw.platforms.segway import protocol as p
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
"""Volts between which the battery's charge is estimated, along a straight line; guessed around the nominal 72."""

_EARLY: Final = 0.01
"""Seconds: half the shortest time between two cycles that come."""

_SCALED: Final = {
    "leftSpeed": "left_speed",
    "rightSpeed": "right_speed",
    "forward": "forward",
    "yaw": "yaw",
    "left": "left",
    "right": "right",
}
"""Slot -> item; the coefficient is the slot with ``Coeff`` behind it."""
_WAY: Final = frozenset({"forward", "yaw"})
"""Items that the odometry needs."""
_ANGLES: Final = {"pitch": "pitch", "pitchRate": "pitch_rate", "roll": "roll", "rollRate": "roll_rate"}
_SHARES: Final = {
    "speedScale": ("velocity_scale", FULL_SCALE),
    "accelerationScale": ("acceleration_scale", FULL_SCALE),
    "turnScale": ("turn_scale", FULL_SCALE),
    "currentLimit": ("current_limit", FULL_CURRENT),
}
"""Slot of 0..1 -> (configuration, what 1 is)."""
_OFF: Final = (p.MODES[0], p.MODES[3])
"""The modes in which it does not obey speeds."""
_NAMED: Final = {"mode": p.MODES, "gain": p.GAINS}


class Base(Protocol):
    """What an RMP needs of the robot."""

    settings: dict[str, int]
    """Configurations as last sent."""

    motion: Motion
    """Who may move it."""

    def aim(self, item: str, counts: int, origin: Origin) -> None:
        """Send a speed with the next command."""
        ...

    def order(self, slot: str, name: str, parameter: int) -> None:
        """Configure the base."""
        ...


class RMP(EffectorDevice):
    """One face of the base."""

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

    def attach(self, base: Base, period: float) -> None:
        """Belong to a base and show it every ``period`` seconds; ``init`` in ``usegway.u`` sees to it, once."""
        self._base = base
        self.period.sense(period)
        self._due = -math.inf
        self._raw: Mapping[str, int] = {}
        self._place = [0.0, 0.0, 0.0]
        self._last: tuple[int, float, float] | None = None
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
        self.notify_change(self.lockout, lambda: base.order("lockout", "lockout", int(bool(number(self.lockout)))))
        self.configured()

    # ---------------------------------------------------------------- what urbiscript calls

    @function("resetCoders")
    def reset_coders(self) -> None:
        """Let ``forward``, ``yaw``, ``left`` and ``right`` begin at zero; it takes a quarter of a second."""
        self._base.order("resetCoders", "reset", p.ALL_INTEGRATORS)

    @function
    def odometry(self) -> list[float]:
        """Where the base is since the first reading: x and y in m, heading in rad, counter-clockwise.

        An error while the base does not tell it: whoever goes a way by it must not wait for its end.
        """
        if self._raw and not self._raw.keys() >= _WAY:
            raise ValueError(f"the base does not tell its way: {missing_words(self._raw['missing'])} missing")
        return list(self._place)

    # ---------------------------------------------------------------- written

    def _drive(self, var: UVar, item: str, coefficient: UVar) -> Any:
        guard = self.guard(self._base.motion, BASE, var)

        def write() -> None:
            per_count = coefficient.value * self._scale(item)
            # At scale 0 nothing moves, whatever is asked for.
            self._base.aim(item, round(number(var) / per_count) if per_count else 0, guard.origin)

        return write

    def explain_off(self) -> str:
        """See ``EffectorDevice``."""
        if self.mode.sensed not in _OFF:
            return ""
        return f'the base does not drive (mode {self.mode.sensed}): switch it on with mode = "tractor" or "balance"'

    def _check(self, coefficient: UVar) -> None:
        if number(coefficient) == 0:
            raise ValueError("a coefficient is a number other than 0: SI units per count")
        self.configured()
        self._show()

    def _share(self, var: UVar, item: str, full: int) -> Any:
        return lambda: self._base.order(var.name, item, round(number(var) * full))

    def _name(self, var: UVar, words: tuple[str, ...]) -> Any:
        def write() -> None:
            if var.value not in words:
                raise ValueError(f"{var.name} is one of {', '.join(words)}, not {var.value!r}")
            self._base.order(var.name, var.name, words.index(var.value))

        return write

    def _scale(self, item: str) -> float:
        """The share of a command that the base obeys."""
        return self._base.settings.get(f"{item}_scale", FULL_SCALE) / FULL_SCALE

    def configured(self) -> None:
        """What the base was told has changed: show it, and what can be asked of it."""
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

    def limits_in_counts(self, limits: DeviceLimits, named: Named) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """See ``platforms.base.Limited``: m/s, rad/s, m/s2, by what full scale is.

        Coefficients and scales are for programs to change; what is limited does not change with them.
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
        """See ``platforms.base.Limited``."""
        coefficient = self.velocityCoeff if message.item == "velocity" else self.turnCoeff
        self.limit_applied(message.applied * coefficient.value * self._scale(message.item), message.limit)

    # ---------------------------------------------------------------- read

    def offer(self, raw: Mapping[str, int], stamp: float) -> None:
        """Take a cycle if it is time for one."""
        period = float(self.period.sensed)
        # One that comes a little early is the one that is meant.
        if stamp < self._due - _EARLY:
            return
        self._due = max(self._due + period, stamp - period)
        self.take(raw, stamp)

    def take(self, raw: Mapping[str, int], stamp: float) -> None:
        """Take a cycle, in counts."""
        self._raw = raw
        self._show(stamp)
        self._travel(raw)
        self.stale.sense(False)

    def changed_state(self, state: str) -> None:
        """The base is "ok" or "lost"."""
        self.state.sense(state)
        if state != "ok":
            self.stale.sense(True)
            self._last = None

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
        """What old firmware does not tell, or only part of it."""
        self.leftTorque.sense(raw.get("left_torque", math.nan) * per_torque, stamp)
        self.rightTorque.sense(raw.get("right_torque", math.nan) * per_torque, stamp)
        volts = raw.get("battery", math.nan) / 4
        self.voltage.sense(volts, stamp)
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
            self._show_fault("not known: the base does not send its status")

    def _show_fault(self, words: str) -> None:
        if words != self.fault.sensed:
            self.fault.sense(words)
            if words:
                self.faulted.emit(words)

    def _travel(self, raw: Mapping[str, int]) -> None:
        """Add the way since the last cycle to the place."""
        if not raw.keys() >= _WAY:
            # What was gone meanwhile is added when the counters are there again.
            return
        forward, yaw = self.forward.sensed, self.yaw.sensed
        last, self._last = self._last, (raw["resets"], forward, yaw)
        if last is None or last[0] != raw["resets"]:
            return
        way, turned = forward - last[1], yaw - last[2]
        middle = self._place[2] + turned / 2
        self._place[0] += way * math.cos(middle)
        self._place[1] += way * math.sin(middle)
        self._place[2] += turned
