"""Raw counts to SI and back, for every item of every table.

Slots of devices are in SI units: rad, rad/s, rad/s2, V, A, s, degrees Celsius; torque, load and PWM are fractions of
full scale. Registers are raw counts. This is the only file that converts between them::

    item = tables.table_named("AX-12").item("goal_position")
    to_si(item, 512)        # 0.0026 rad
    from_si(item, 0.5)      # 609
    limits_si(item)         # (-2.618, 2.618)

Positions are centred: 0 is the middle of the first turn (AX: 511.5, X: 2048, PRO: 0), and positive is
counter-clockwise, seen from the front. In wheel mode pass `wheel=True`: speeds of the AX series are then fractions of
full drive.

A unit is a row of `UNITS`, or, where the scale differs from model to model, is written into the table: "turn/N" is a
position of N counts a turn with 0 in the middle, "rpm*F" and the like (`_BASES`) is F of that unit a count.
Sources: ROBOTIS e-manual, the pages of the models (EX-106+: 251 degrees in 12 bits; MX: 0.114 rpm, MX-12W 0.916 rpm,
4.5 mA, 8.583 degrees/s2; P: PWM limit 2009); pypot `dynamixel/conversion.py` for the centred form.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Final

from urbihw.buses.errors import BadValue
from urbihw.buses.servos.item import Item
from urbihw.frozen import frozen

_DIRECTION = 0x400  # bit 10 of AX speeds and loads: set means clockwise, which is negative
_AX_FULL = 1023
_AX_STEP = math.radians(300) / _AX_FULL
_AX_SPEED = math.radians(0.666)  # about 0.111 rpm
_X_STEP = math.radians(360) / 4096
_RPM = math.tau / 60
_X_VELOCITY = 0.229 * _RPM
_X_ACCELERATION = 214.577 * _RPM / 60
_EX_STEP = math.radians(251) / 4095
_MX_SPEED = 0.114 * _RPM
_MX12_SPEED = 0.916 * _RPM
_MX_AMPERE = 4.5e-3
_SCS_STEP = math.radians(300) / 1024
_FEETECH_BAUDS: Final = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)
_X_BAUDS: Final = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
_BASES: Final = {
    "rpm": ("rad/s", _RPM),
    "rpm2": ("rad/s2", _RPM / 60),
    "A": ("A", 1.0),
    "s": ("s", 1.0),
    "V/s": ("V/s", 1.0),
}
"""Name in a table -> SI unit, and how many of that it is; "rpm2" is rev/min2."""


@frozen
class CountUnit:
    """The conversion between raw counts and SI units.

    Attributes:
        symbol: of the SI unit, "" for plain numbers and fractions.
        to_si: raw count to SI value.
        to_raw: SI value to the nearest raw count, unchecked.
        high: largest raw count with a value in this unit, if the register accepts more.
        both_ways: a bit of the raw count is the sign, so that values reach from -`high` to `high`.
    """

    symbol: str
    to_si: Callable[[int], float]
    to_raw: Callable[[float], int]
    high: int | None = None
    both_ways: bool = False


def _linear(symbol: str, step: float, zero: float = 0.0) -> CountUnit:
    return CountUnit(symbol, lambda raw: (raw - zero) * step, lambda value: round(value / step + zero))


def _sign_magnitude(symbol: str, step: float) -> CountUnit:
    def to_si(raw: int) -> float:
        size = (raw & _AX_FULL) * step
        return -size if raw & _DIRECTION else size

    def to_raw(value: float) -> int:
        size = min(round(abs(value) / step), _AX_FULL)
        return size | _DIRECTION if value < 0 and size else size

    return CountUnit(symbol, to_si, to_raw, both_ways=True)


def _unlimited_at_zero(symbol: str, step: float, high: int | None = None) -> CountUnit:
    """Raw 0 means "no limit" and is infinity; the lowest limit is raw 1."""
    return CountUnit(
        symbol,
        lambda raw: raw * step if raw else math.inf,
        lambda value: 0 if value == math.inf else max(1, round(value / step)),
        high,
    )


def _ax_baud() -> CountUnit:
    return CountUnit("bit/s", lambda raw: 2e6 / (raw + 1), lambda value: round(2e6 / value) - 1)


def _baud(*speeds: int) -> CountUnit:
    return CountUnit(
        "bit/s",
        lambda raw: float(speeds[raw]) if raw < len(speeds) else math.nan,
        lambda value: min(range(len(speeds)), key=lambda index: abs(speeds[index] - value)),
        len(speeds) - 1,
    )


def _mx_baud() -> CountUnit:
    """As `ax_baud` up to 249, then three speeds of their own."""
    fast = {250: 2_250_000, 251: 2_500_000, 252: 3_000_000}
    return CountUnit(
        "bit/s",
        lambda raw: float(fast.get(raw, 2_000_000 / (raw + 1))),
        lambda value: next((raw for raw, speed in fast.items() if speed == value), round(2e6 / value) - 1),
    )


def _sts_goal_speed() -> CountUnit:
    """Raw 0 means "no limit" for a joint; the register is that of the speed of a wheel, so it has negative counts."""
    plain = _linear("rad/s", _X_STEP)
    return CountUnit(
        "rad/s",
        lambda raw: plain.to_si(raw) if raw else math.inf,
        lambda value: 0 if value == math.inf else plain.to_raw(value) or 1,
    )


def _buzzer_time() -> CountUnit:
    """0.3 to 5 s in tenths; 254 rings until 0 is written. 255 (play a melody) is no duration: write it raw."""
    return CountUnit(
        "s",
        lambda raw: math.inf if raw >= 254 else min(max(raw, 3), 50) / 10,
        lambda value: 254 if math.isinf(value) else 0 if value <= 0 else min(max(round(value * 10), 3), 50),
    )


UNITS: Final = {
    "count": _linear("", 1),
    "voltage": _linear("V", 0.1),
    "temperature": _linear("degC", 1),
    "delay": _linear("s", 2e-6),
    "millisecond": _linear("s", 1e-3),
    "watchdog": _linear("s", 0.02),
    "sound_time": _linear("s", 62.5e-9),
    "buzzer_time": _buzzer_time(),
    "ax_baud": _ax_baud(),
    "ax_position": _linear("rad", _AX_STEP, _AX_FULL / 2),
    "ax_angle": _linear("rad", _AX_STEP),
    "ax_goal_speed": _unlimited_at_zero("rad/s", _AX_SPEED, _AX_FULL),
    "ax_speed": _sign_magnitude("rad/s", _AX_SPEED),
    "ax_wheel": _sign_magnitude("", 1 / _AX_FULL),
    "ax_load": _sign_magnitude("", 1 / _AX_FULL),
    "ax_torque": _linear("", 1 / _AX_FULL),
    "ex_position": _linear("rad", _EX_STEP, 4095 / 2),
    "ex_angle": _linear("rad", _EX_STEP),
    # Less than 512 is torque to the counter-clockwise side.
    "ex_current": _linear("A", -0.01, 512),
    "mx_goal_speed": _unlimited_at_zero("rad/s", _MX_SPEED, _AX_FULL),
    "mx_speed": _sign_magnitude("rad/s", _MX_SPEED),
    "mx12_goal_speed": _unlimited_at_zero("rad/s", _MX12_SPEED, _AX_FULL),
    "mx12_speed": _sign_magnitude("rad/s", _MX12_SPEED),
    "mx_acceleration": _unlimited_at_zero("rad/s2", math.radians(8.583)),
    "mx_current": _linear("A", _MX_AMPERE, 2048),
    "mx_torque": _sign_magnitude("A", _MX_AMPERE),
    "mx_baud": _mx_baud(),
    "x_baud": _baud(*_X_BAUDS),
    "p_baud": _baud(*_X_BAUDS, 6_000_000, 10_500_000),
    "pro_baud": _baud(*_X_BAUDS, 10_500_000),
    "p_pwm": _linear("", 1 / 2009),
    "p_profile_velocity": _unlimited_at_zero("rad/s", 0.01 * _RPM),
    "p_profile_acceleration": _unlimited_at_zero("rad/s2", _RPM / 60),
    "x_position": _linear("rad", _X_STEP, 2048),
    "x_angle": _linear("rad", _X_STEP),
    "x_velocity": _linear("rad/s", _X_VELOCITY),
    "x_acceleration": _linear("rad/s2", _X_ACCELERATION),
    "x_profile_velocity": _unlimited_at_zero("rad/s", _X_VELOCITY),
    "x_profile_acceleration": _unlimited_at_zero("rad/s2", _X_ACCELERATION),
    "x_pwm": _linear("", 1 / 885),
    "x_load": _linear("", 1e-3),
    "milliampere": _linear("A", 1e-3),
    "xm_current": _linear("A", 2.69e-3),
    "percent": _linear("", 0.01),
    "feetech_baud": _baud(*_FEETECH_BAUDS),
    "sts_speed": _linear("rad/s", _X_STEP),
    "sts_goal_speed": _sts_goal_speed(),
    "sts_acceleration": _unlimited_at_zero("rad/s2", 100 * _X_STEP),
    "scs_position": _linear("rad", _SCS_STEP, 512),
    "scs_speed": _linear("rad/s", _SCS_STEP),
    "scs_goal_speed": _unlimited_at_zero("rad/s", _SCS_STEP),
    "pwm_slope": _linear("V/s", 1.977),
}


def unit_of(item: Item, wheel: bool = False) -> CountUnit:
    """Return the unit of `item`; `wheel`: the servo is in wheel mode."""
    return unit_named(item.wheel_unit if wheel and item.wheel_unit else item.unit)


@cache
def unit_named(name: str) -> CountUnit:
    """Return a unit by its name in a table. Raises KeyError and ValueError for a mistake in the table."""
    if name in UNITS:
        return UNITS[name]
    if name.startswith("turn/"):
        return _linear("rad", math.tau / int(name.removeprefix("turn/")))
    base, _, factor = name.partition("*")
    symbol, scale = _BASES[base]
    return _linear(symbol, scale * float(factor))


def to_si(item: Item, raw: int, wheel: bool = False) -> float:
    """Return a raw count in SI units."""
    return unit_of(item, wheel).to_si(raw)


def from_si(item: Item, value: float, wheel: bool = False) -> int:
    """Return the raw count nearest to `value`. Raises BadValue for nan and outside the range of the item."""
    unit = unit_of(item, wheel)
    try:
        raw = unit.to_raw(value)
    except (ValueError, OverflowError, ZeroDivisionError) as error:
        raise BadValue(f"{item.name} cannot be {value}") from error
    if not item.low <= raw <= _high(item, unit):
        low, high = limits_si(item, wheel)
        raise BadValue(f"{item.name} takes {low:g}..{high:g} {unit.symbol}".rstrip() + f", not {value:g}")
    return raw


def limits_si(item: Item, wheel: bool = False) -> tuple[float, float]:
    """Return the smallest and the largest value that `from_si` accepts, for a UVar's rangemin and rangemax."""
    unit = unit_of(item, wheel)
    if unit.both_ways:
        full = unit.to_si(_AX_FULL)
        return -full, full
    ends = [unit.to_si(item.low), unit.to_si(_high(item, unit))]
    if math.inf in ends:
        ends.append(unit.to_si(max(item.low, 1)))
    return min(ends), max(ends)


def _high(item: Item, unit: CountUnit) -> int:
    return item.high if unit.high is None else min(item.high, unit.high)
