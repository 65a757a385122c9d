"""RX, EX, MX, XL-320, P, PRO and Y: the control tables, and the numbers of their motion, of one or two models each.

Source: ROBOTIS' e-manual, pages rx-28, rx-64, ex-106+, mx-28, mx-64, mx-12w, xl320, ph54-200-s500-r, h54-200-s500-r
and ym070-210-r099-rh. Only rows with a meaning here are in the tables; the others read as 0 and refuse writes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from urbihw_fakes.dynamixel.registers import Register

HIGH32 = (1 << 31) - 1


@dataclass(frozen=True, slots=True)
class Family:
    """What a model is.

    Attributes:
        number, firmware: as it tells them.
        rows: of its control table.
        counts: position counts of one turn.
        rpm: of one count of its speeds.
        full_rpm: without load.
        middle: count at the middle of its range, where it stands when it is made.
        volts: nominal supply.
        shares: speeds of a wheel are shares of full drive (in 1/1023), not rpm.
    """

    number: int
    firmware: int
    rows: tuple[Register, ...]
    counts: float
    rpm: float
    full_rpm: float
    middle: int
    volts: float
    shares: bool = False


def _kept(name: str, address: int, size: int, default: int, high: int, low: int = 0) -> Register:
    """Return a row of the EEPROM."""
    return Register(name, address, size, default, low, high, eeprom=True, signed=low < 0)


def _rom(name: str, address: int, size: int, default: int = 0) -> Register:
    return Register(name, address, size, default, writable=False, eeprom=True)


def _live(name: str, address: int, size: int, default: int, high: int, low: int = 0) -> Register:
    """Return a row of the RAM."""
    return Register(name, address, size, default, low, high, signed=low < 0)


def _seen(name: str, address: int, size: int, signed: bool = False) -> Register:
    return Register(name, address, size, writable=False, signed=signed)


def _old(number: int, highest: int, max_volts: int, own: tuple[Register, ...], baud: int = 34) -> tuple[Register, ...]:
    """The rows that RX, EX and MX share; `highest` position of a turn."""
    signed = any(row.name == "multi_turn_offset" for row in own)
    goal = (28672, -28672) if signed else (highest, 0)
    return (
        _rom("model", 0, 2, number),
        _rom("firmware", 2, 1, 40),
        _kept("id", 3, 1, 1, 253),
        _kept("baud", 4, 1, baud, 254),
        _kept("return_delay", 5, 1, 250, 254),
        _kept("low_limit", 6, 2, 0, highest),
        _kept("high_limit", 8, 2, highest, highest),
        _kept("temperature_limit", 11, 1, 80, 150),
        _kept("min_voltage", 12, 1, 60, 250, 50),
        _kept("max_voltage", 13, 1, max_volts, 250, 50),
        _kept("max_torque", 14, 2, 1023, 1023),
        _kept("status_level", 16, 1, 2, 2),
        _kept("alarm_led", 17, 1, 36, 127),
        _kept("shutdown", 18, 1, 36, 127),
        _live("torque_enable", 24, 1, 0, 1),
        _live("led", 25, 1, 0, 1),
        _live("goal_position", 30, 2, 0, *goal),
        _live("speed", 32, 2, 0, 2047),
        _live("torque_limit", 34, 2, 1023, 1023),
        _seen("present_position", 36, 2, signed),
        _seen("present_speed", 38, 2),
        _seen("present_load", 40, 2),
        _seen("present_voltage", 42, 1),
        _seen("present_temperature", 43, 1),
        _seen("registered", 44, 1),
        _seen("moving", 46, 1),
        _live("lock", 47, 1, 0, 1, 1),
        _live("punch", 48, 2, 0, 1023),
        *own,
    )


_COMPLIANCE = (
    _live("cw_margin", 26, 1, 1, 254),
    _live("ccw_margin", 27, 1, 1, 254),
    _live("cw_slope", 28, 1, 32, 254, 1),
    _live("ccw_slope", 29, 1, 32, 254, 1),
)
_SENSED_CURRENT = (_seen("sensed_current", 56, 2),)
_PID = (
    _kept("multi_turn_offset", 20, 2, 0, 24576, -24576),
    _kept("resolution_divider", 22, 1, 1, 4, 1),
    _live("d_gain", 26, 1, 0, 254),
    _live("i_gain", 27, 1, 0, 254),
    _live("p_gain", 28, 1, 32, 254),
    _seen("realtime_tick", 50, 2),
    _live("goal_acceleration", 73, 1, 0, 254),
)
_TORQUE = (
    _seen("present_current", 68, 2),
    _live("torque_control", 70, 1, 0, 1),
    _live("goal_torque", 71, 2, 0, 2047),
)

_XL320 = (
    _rom("model", 0, 2, 350),
    _rom("firmware", 2, 1, 29),
    _kept("id", 3, 1, 1, 252),
    _kept("baud", 4, 1, 3, 3),
    _kept("return_delay", 5, 1, 250, 254),
    _kept("low_limit", 6, 2, 0, 1023),
    _kept("high_limit", 8, 2, 1023, 1023),
    _kept("mode", 11, 1, 2, 2, 1),
    _kept("temperature_limit", 12, 1, 65, 150),
    _kept("min_voltage", 13, 1, 60, 250, 50),
    _kept("max_voltage", 14, 1, 90, 250, 50),
    _kept("max_torque", 15, 2, 1023, 1023),
    _kept("status_level", 17, 1, 2, 2),
    _kept("shutdown", 18, 1, 3, 7),
    _live("torque_enable", 24, 1, 0, 1),
    _live("led", 25, 1, 0, 7),
    _live("d_gain", 27, 1, 0, 254),
    _live("i_gain", 28, 1, 0, 254),
    _live("p_gain", 29, 1, 32, 254),
    _live("goal_position", 30, 2, 0, 1023),
    _live("speed", 32, 2, 0, 2047),
    _live("torque_limit", 35, 2, 1023, 1023),
    _seen("present_position", 37, 2),
    _seen("present_speed", 39, 2),
    _seen("present_load", 41, 2),
    _seen("present_voltage", 45, 1),
    _seen("present_temperature", 46, 1),
    _seen("registered", 47, 1),
    _seen("moving", 49, 1),
    _seen("hardware_error", 50, 1),
    _live("punch", 51, 2, 32, 1023),
)

_PH54 = (
    _rom("model", 0, 2, 2020),
    _rom("model_information", 2, 4),
    _rom("firmware", 6, 1, 11),
    _kept("id", 7, 1, 1, 252),
    _kept("baud", 8, 1, 1, 9),
    _kept("return_delay", 9, 1, 250, 254),
    _kept("drive_mode", 10, 1, 0, 13),
    _kept("mode", 11, 1, 3, 16),
    _kept("secondary_id", 12, 1, 255, 255),
    _kept("homing_offset", 20, 4, 0, HIGH32, -HIGH32 - 1),
    _kept("moving_threshold", 24, 4, 20, 2900),
    _kept("temperature_limit", 31, 1, 80, 100),
    _kept("max_voltage", 32, 2, 350, 350, 150),
    _kept("min_voltage", 34, 2, 150, 350, 150),
    _kept("pwm_limit", 36, 2, 2009, 2009),
    _kept("current_limit", 38, 2, 22740, 22740),
    _kept("acceleration_limit", 40, 4, 3_992_644, 3_992_644),
    _kept("velocity_limit", 44, 4, 2900, 2900),
    _kept("high_limit", 48, 4, 501_433, 501_923, -501_923),
    _kept("low_limit", 52, 4, -501_433, 501_923, -501_923),
    _kept("shutdown", 63, 1, 52, 63),
    _live("torque_enable", 512, 1, 0, 1),
    _live("led_red", 513, 1, 0, 255),
    _live("status_level", 516, 1, 2, 2),
    _seen("registered", 517, 1),
    _seen("hardware_error", 518, 1),
    _live("position_p", 532, 2, 314, 32767),
    _live("bus_watchdog", 546, 1, 0, 127, -1),
    _live("goal_pwm", 548, 2, 0, 2009, -2009),
    _live("goal_current", 550, 2, 0, 22740, -22740),
    _live("goal_velocity", 552, 4, 0, 2900, -2900),
    _live("profile_acceleration", 556, 4, 0, 3_992_644),
    _live("profile_velocity", 560, 4, 0, 2900),
    _live("goal_position", 564, 4, 0, HIGH32, -HIGH32 - 1),
    _seen("moving", 570, 1),
    _seen("present_current", 574, 2, True),
    _seen("present_velocity", 576, 4, True),
    _seen("present_position", 580, 4, True),
    _seen("present_voltage", 592, 2),
    _seen("present_temperature", 594, 1),
)

_H54 = (
    _rom("model", 0, 2, 54024),
    _rom("model_information", 2, 4),
    _rom("firmware", 6, 1, 17),
    _kept("id", 7, 1, 1, 252),
    _kept("baud", 8, 1, 1, 13),
    _kept("return_delay", 9, 1, 250, 255),
    _kept("mode", 11, 1, 3, 4),
    _kept("homing_offset", 13, 4, 0, HIGH32, -HIGH32 - 1),
    _kept("moving_threshold", 17, 4, 50, HIGH32),
    _kept("temperature_limit", 21, 1, 80, 100),
    _kept("max_voltage", 22, 2, 400, 400),
    _kept("min_voltage", 24, 2, 150, 400),
    _kept("current_limit", 30, 2, 620, 1860),
    _kept("velocity_limit", 32, 4, 17_000, HIGH32),
    _kept("high_limit", 36, 4, 250_961, HIGH32, -HIGH32 - 1),
    _kept("low_limit", 40, 4, -250_961, HIGH32, -HIGH32 - 1),
    _kept("shutdown", 48, 1, 58, 255),
    _live("torque_enable", 562, 1, 0, 1),
    _live("led_red", 563, 1, 0, 255),
    _live("position_p", 594, 2, 32, 65535),
    _live("goal_position", 596, 4, 0, HIGH32, -HIGH32 - 1),
    _live("goal_velocity", 600, 4, 0, 17_000, -17_000),
    _live("goal_current", 604, 2, 0, 1860, -1860),
    _live("goal_acceleration", 606, 4, 0, HIGH32),
    _seen("moving", 610, 1),
    _seen("present_position", 611, 4, True),
    _seen("present_velocity", 615, 4, True),
    _seen("present_current", 621, 2, True),
    _seen("present_voltage", 623, 2),
    _seen("present_temperature", 625, 1),
    _seen("registered", 890, 1),
    _live("status_level", 891, 1, 2, 2),
    _seen("hardware_error", 892, 1),
)

_Y = (
    _rom("model", 0, 2, 4030),
    _rom("model_information", 2, 4),
    _rom("firmware", 6, 1, 12),
    _kept("id", 7, 1, 1, 252),
    _live("bus_watchdog", 8, 2, 0, 127, -1),
    _kept("secondary_id", 10, 1, 255, 255),
    _kept("baud", 12, 1, 1, 9),
    _kept("return_delay", 13, 1, 250, 254),
    _live("status_level", 15, 1, 2, 2),
    _seen("registered", 16, 1),
    _kept("drive_mode", 32, 1, 0, 77),
    _kept("mode", 33, 1, 3, 3),
    _kept("temperature_limit", 57, 1, 60, 100),
    _kept("max_voltage", 60, 2, 320, 400, 240),
    _kept("min_voltage", 62, 2, 160, 400, 160),
    _kept("current_limit", 66, 2, 2080, 2080),
    _kept("velocity_limit", 72, 4, 2020, 6486),
    _kept("high_limit", 76, 4, 262_144, HIGH32, -HIGH32 - 1),
    _kept("low_limit", 84, 4, -262_144, HIGH32, -HIGH32 - 1),
    _seen("hardware_error", 153, 1),
    _live("profile_velocity", 244, 4, 2020, 6486),
    _live("torque_enable", 512, 1, 0, 1),
    _live("led", 513, 1, 0, 1),
    _live("goal_pwm", 524, 2, 0, 1000, -1000),
    _live("goal_current", 526, 2, 0, 2080, -2080),
    _live("goal_velocity", 528, 4, 0, 6486, -6486),
    _live("goal_position", 532, 4, 0, HIGH32, -HIGH32 - 1),
    _seen("moving_status", 541, 1),
    _seen("present_current", 546, 2, True),
    _seen("present_velocity", 548, 4, True),
    _seen("present_position", 552, 4, True),
    _seen("present_voltage", 568, 2),
    _seen("inverter_temperature", 570, 1),
    _seen("present_temperature", 571, 1),
)

_RX_COUNTS = 1023 * 360 / 300
_RX28 = Family(28, 40, _old(28, 1023, 190, _COMPLIANCE), _RX_COUNTS, 0.111, 67, 512, 14.8, shares=True)
_EX106 = _old(107, 4095, 240, _COMPLIANCE + _SENSED_CURRENT)
_MX28 = Family(29, 40, _old(29, 4095, 160, _PID), 4096, 0.114, 55, 2048, 12.0)
_MX64 = Family(310, 40, _old(310, 4095, 240, _PID + _TORQUE), 4096, 0.114, 63, 2048, 12.0)

FAMILIES = {
    "RX-24F": replace(_RX28, number=24, rows=_old(24, 1023, 190, _COMPLIANCE), full_rpm=126, volts=12.0),
    "RX-28": _RX28,
    "RX-64": replace(_RX28, number=64, rows=_old(64, 1023, 190, _COMPLIANCE), full_rpm=64),
    "DX-117": replace(_RX28, number=117, rows=_old(117, 1023, 190, _COMPLIANCE), full_rpm=85),
    "EX-106+": Family(107, 40, _EX106, 4095 * 360 / 251, 0.111, 91, 2048, 14.8, shares=True),
    "MX-12W": replace(_MX28, number=104, rows=_old(104, 4095, 160, _PID, baud=1), rpm=0.916, full_rpm=470),
    "MX-28": _MX28,
    "MX-64": _MX64,
    "MX-106": replace(_MX64, number=320, rows=_old(320, 4095, 160, _PID + _TORQUE), full_rpm=45),
    "XL-320": Family(350, 29, _XL320, _RX_COUNTS, 0.111, 114, 512, 7.4, shares=True),
    "PH54-200-S500-R": Family(2020, 11, _PH54, 1_003_846, 0.01, 33.1, 0, 24.0),
    "H54-200-S500-R": Family(54024, 17, _H54, 501_923, 0.00199234, 33.1, 0, 24.0),
    "YM070-210-R099-RH": Family(4030, 12, _Y, 524_288, 0.01, 20.2, 0, 24.0),
}
