"""Control tables as data: AX-12, AX-S1, XL330, XL430, XM430, and the model numbers that use them.

Rows: name, address, size, access, area (E kept without power, R reset), low, high, default, unit, wheel unit.
Sources: ROBOTIS e-manual, pages ax-12a, ax-s1, xl330-m288, xl430-w250 and xm430-w350; the AX-12 manual for its write
ranges; Gostai's Bioloid manual for AX-S1 11..13, 20, 21, 42 and 43.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from urbihw.buses.servos.item import Item, Mode, Motion, Table, by_name

_JOINT: Final = Mode("joint", "goal_position", Motion.POSITION, ("cw_angle_limit", "ccw_angle_limit"))
_WHEEL: Final = Mode("wheel", "moving_speed", Motion.RATE)

_BYTE = 255
_WORD = 65535
_STEP = 1023  # full scale of the AX series, for positions, speeds and torques

_COMMON_1: Final = (
    Item("model_number", 0, 2, "R", "E", 0, _WORD, None),
    Item("firmware_version", 2, 1, "R", "E", 0, _BYTE, None),
    Item("baud_rate", 4, 1, "RW", "E", 0, 254, 1, "ax_baud"),
    Item("return_delay_time", 5, 1, "RW", "E", 0, 254, 250, "delay"),
    Item("min_voltage_limit", 12, 1, "RW", "E", 50, 250, 60, "voltage"),
    Item("max_voltage_limit", 13, 1, "RW", "E", 50, 250, 140, "voltage"),
    Item("status_return_level", 16, 1, "RW", "E", 0, 2, 2),
    Item("present_voltage", 42, 1, "R", "R", 0, _BYTE, None, "voltage"),
    Item("present_temperature", 43, 1, "R", "R", 0, _BYTE, None, "temperature"),
)

AX12: Final = Table(
    name="AX-12",
    protocol=1,
    models={12: "AX-12A", 18: "AX-18A", 300: "AX-12W"},
    mode_items=("cw_angle_limit", "ccw_angle_limit"),
    modes={0: _WHEEL, 1: _JOINT},
    items=by_name(
        (
            *_COMMON_1,
            Item("id", 3, 1, "RW", "E", 0, 253, 1),
            Item("cw_angle_limit", 6, 2, "RW", "E", 0, _STEP, 0, "ax_position"),
            Item("ccw_angle_limit", 8, 2, "RW", "E", 0, _STEP, _STEP, "ax_position"),
            Item("temperature_limit", 11, 1, "RW", "E", 0, 150, 70, "temperature"),
            Item("max_torque", 14, 2, "RW", "E", 0, _STEP, _STEP, "ax_torque"),
            Item("alarm_led", 17, 1, "RW", "E", 0, 127, 36),
            Item("shutdown", 18, 1, "RW", "E", 0, 127, 36),
            Item("down_calibration", 20, 2, "R", "E", 0, _WORD, None),
            Item("up_calibration", 22, 2, "R", "E", 0, _WORD, None),
            Item("torque_enable", 24, 1, "RW", "R", 0, 1, 0),
            Item("led", 25, 1, "RW", "R", 0, 1, 0),
            Item("cw_compliance_margin", 26, 1, "RW", "R", 0, 254, 1, "ax_angle"),
            Item("ccw_compliance_margin", 27, 1, "RW", "R", 0, 254, 1, "ax_angle"),
            Item("cw_compliance_slope", 28, 1, "RW", "R", 1, 254, 32),
            Item("ccw_compliance_slope", 29, 1, "RW", "R", 1, 254, 32),
            Item("goal_position", 30, 2, "RW", "R", 0, _STEP, None, "ax_position"),
            # Joint mode takes 0..1023; in wheel mode bit 10 is the direction. The servo refuses what does not fit.
            Item("moving_speed", 32, 2, "RW", "R", 0, 2047, None, "ax_goal_speed", "ax_wheel"),
            Item("torque_limit", 34, 2, "RW", "R", 0, _STEP, None, "ax_torque"),
            Item("present_position", 36, 2, "R", "R", 0, _STEP, None, "ax_position"),
            Item("present_speed", 38, 2, "R", "R", 0, 2047, None, "ax_speed", "ax_wheel"),
            Item("present_load", 40, 2, "R", "R", 0, 2047, None, "ax_load"),
            Item("registered", 44, 1, "R", "R", 0, 1, 0),
            Item("moving", 46, 1, "R", "R", 0, 1, 0),
            Item("lock", 47, 1, "RW", "R", 0, 1, 0),
            Item("punch", 48, 2, "RW", "R", 0, _STEP, 32, "ax_torque"),
        )
    ),
)

AXS1: Final = Table(
    name="AX-S1",
    protocol=1,
    models={13: "AX-S1"},
    items=by_name(
        (
            *_COMMON_1,
            Item("id", 3, 1, "RW", "E", 0, 253, 100),
            Item("temperature_limit", 11, 1, "RW", "E", 0, 150, None, "temperature"),
            Item("obstacle_threshold", 20, 1, "RW", "E", 0, _BYTE, None),
            Item("light_threshold", 21, 1, "RW", "E", 0, _BYTE, None),
            Item("ir_left", 26, 1, "R", "R", 0, _BYTE, None),
            Item("ir_center", 27, 1, "R", "R", 0, _BYTE, None),
            Item("ir_right", 28, 1, "R", "R", 0, _BYTE, None),
            Item("light_left", 29, 1, "R", "R", 0, _BYTE, None),
            Item("light_center", 30, 1, "R", "R", 0, _BYTE, None),
            Item("light_right", 31, 1, "R", "R", 0, _BYTE, None),
            Item("obstacle_detected", 32, 1, "R", "R", 0, 7, None),
            Item("light_detected", 33, 1, "R", "R", 0, 7, None),
            Item("sound", 35, 1, "R", "R", 0, _BYTE, None),
            Item("sound_max_hold", 36, 1, "RW", "R", 0, _BYTE, None),
            Item("sound_count", 37, 1, "RW", "R", 0, _BYTE, None),
            Item("sound_time", 38, 2, "RW", "R", 0, _WORD, None, "sound_time"),
            Item("buzzer_index", 40, 1, "RW", "R", 0, 51, None),
            Item("buzzer_time", 41, 1, "RW", "R", 0, _BYTE, None, "buzzer_time"),
            Item("registered", 44, 1, "RW", "R", 0, 1, 0),
            Item("remocon_arrived", 46, 1, "R", "R", 0, 2, 0),
            Item("lock", 47, 1, "RW", "R", 0, 1, 0),
            Item("remocon_rx", 48, 2, "R", "R", 0, _WORD, None, clears_on_read=True),
            Item("remocon_tx", 50, 2, "RW", "R", 0, _WORD, None),
            Item("obstacle_compare", 52, 1, "RW", "R", 0, _BYTE, None),
            Item("light_compare", 53, 1, "RW", "R", 0, _BYTE, None),
        )
    ),
)


_DOUBLE = (1 << 32) - 1
_TURNS = 1_048_575  # 256 turns of 4096 steps, both ways: extended position mode
_VELOCITY = 1023
_PWM = 885
_LIMITS_X: Final = ("min_position_limit", "max_position_limit")
_MODES_X: Final = {
    0: Mode("current", "goal_current", Motion.RATE),
    1: Mode("velocity", "goal_velocity", Motion.RATE),
    3: Mode("position", "goal_position", Motion.POSITION, _LIMITS_X),
    4: Mode("extended position", "goal_position", Motion.POSITION),
    5: Mode("current-based position", "goal_position", Motion.POSITION),
    16: Mode("pwm", "goal_pwm", Motion.RATE),
}


_GAIN = 16383
_X_SERIES: Final = (
    Item("model_number", 0, 2, "R", "E", 0, _WORD, None),
    Item("model_information", 2, 4, "R", "E", 0, _DOUBLE, None),
    Item("firmware_version", 6, 1, "R", "E", 0, _BYTE, None),
    Item("id", 7, 1, "RW", "E", 0, 252, 1),
    Item("baud_rate", 8, 1, "RW", "E", 0, 7, 1, "x_baud"),
    Item("return_delay_time", 9, 1, "RW", "E", 0, 254, 250, "delay"),
    Item("drive_mode", 10, 1, "RW", "E", 0, 13, 0),
    Item("operating_mode", 11, 1, "RW", "E", 0, 16, 3),
    Item("secondary_id", 12, 1, "RW", "E", 0, _BYTE, _BYTE),
    Item("protocol_type", 13, 1, "RW", "E", 1, 2, 2),
    Item("homing_offset", 20, 4, "RW", "E", -1_044_479, 1_044_479, 0, "x_angle"),
    Item("moving_threshold", 24, 4, "RW", "E", 0, _VELOCITY, 10, "x_velocity"),
    Item("temperature_limit", 31, 1, "RW", "E", 0, 100, None, "temperature"),
    Item("max_voltage_limit", 32, 2, "RW", "E", 31, 160, None, "voltage"),
    Item("min_voltage_limit", 34, 2, "RW", "E", 31, 160, None, "voltage"),
    Item("pwm_limit", 36, 2, "RW", "E", 0, _PWM, _PWM, "x_pwm"),
    Item("velocity_limit", 44, 4, "RW", "E", 0, 2047, None, "x_velocity"),
    Item("max_position_limit", 48, 4, "RW", "E", 0, 4095, 4095, "x_position"),
    Item("min_position_limit", 52, 4, "RW", "E", 0, 4095, 0, "x_position"),
    Item("shutdown", 63, 1, "RW", "E", 0, 63, None),
    Item("torque_enable", 64, 1, "RW", "R", 0, 1, 0),
    Item("led", 65, 1, "RW", "R", 0, 1, 0),
    Item("status_return_level", 68, 1, "RW", "R", 0, 2, 2),
    Item("registered", 69, 1, "R", "R", 0, 1, 0),
    Item("hardware_error", 70, 1, "R", "R", 0, _BYTE, 0),
    Item("velocity_i_gain", 76, 2, "RW", "R", 0, _GAIN, None),
    Item("velocity_p_gain", 78, 2, "RW", "R", 0, _GAIN, None),
    Item("position_d_gain", 80, 2, "RW", "R", 0, _GAIN, None),
    Item("position_i_gain", 82, 2, "RW", "R", 0, _GAIN, None),
    Item("position_p_gain", 84, 2, "RW", "R", 0, _GAIN, None),
    Item("feedforward_2nd_gain", 88, 2, "RW", "R", 0, _GAIN, 0),
    Item("feedforward_1st_gain", 90, 2, "RW", "R", 0, _GAIN, 0),
    Item("bus_watchdog", 98, 1, "RW", "R", -1, 127, 0, "watchdog"),
    Item("goal_pwm", 100, 2, "RW", "R", -_PWM, _PWM, None, "x_pwm"),
    Item("goal_velocity", 104, 4, "RW", "R", -2047, 2047, None, "x_velocity"),
    Item("profile_acceleration", 108, 4, "RW", "R", 0, 32767, 0, "x_profile_acceleration"),
    Item("profile_velocity", 112, 4, "RW", "R", 0, 32767, 0, "x_profile_velocity"),
    Item("goal_position", 116, 4, "RW", "R", -_TURNS, _TURNS, None, "x_position"),
    Item("realtime_tick", 120, 2, "R", "R", 0, 32767, None, "millisecond"),
    Item("moving", 122, 1, "R", "R", 0, 1, 0),
    Item("moving_status", 123, 1, "R", "R", 0, _BYTE, 0),
    Item("present_pwm", 124, 2, "R", "R", -32768, 32767, None, "x_pwm"),
    Item("present_velocity", 128, 4, "R", "R", -(1 << 31), (1 << 31) - 1, None, "x_velocity"),
    Item("present_position", 132, 4, "R", "R", -(1 << 31), (1 << 31) - 1, None, "x_position"),
    Item("velocity_trajectory", 136, 4, "R", "R", -(1 << 31), (1 << 31) - 1, None, "x_velocity"),
    Item("position_trajectory", 140, 4, "R", "R", -(1 << 31), (1 << 31) - 1, None, "x_position"),
    Item("present_voltage", 144, 2, "R", "R", 0, _WORD, None, "voltage"),
    Item("present_temperature", 146, 1, "R", "R", 0, _BYTE, None, "temperature"),
    Item("backup_ready", 147, 1, "R", "R", 0, 1, None),
)
"""The rows that all X series share; a default of None is one that each family names in its own table."""


def _x_items(
    defaults: Mapping[str, int], own: tuple[Item, ...], highs: Mapping[str, int] | None = None
) -> dict[str, Item]:
    """Return the rows of the X series with the defaults and upper bounds of one family, and the family's own rows."""
    rows = {row.name: row for row in _X_SERIES}
    for name, default in defaults.items():
        rows[name] = replace(rows[name], default=default)
    for name, high in (highs or {}).items():
        rows[name] = replace(rows[name], high=high)
    return by_name((*rows.values(), *own))


def _current_items(limit: int, unit: str) -> tuple[Item, ...]:
    return (
        Item("current_limit", 38, 2, "RW", "E", 0, limit, limit, unit),
        Item("goal_current", 102, 2, "RW", "R", -limit, limit, None, unit),
        Item("present_current", 126, 2, "R", "R", -32768, 32767, None, unit),
    )


_STARTUP = Item("startup_configuration", 60, 1, "RW", "E", 0, _BYTE, 0)

XL330: Final = Table(
    name="XL330",
    protocol=2,
    models={1190: "XL330-M077", 1200: "XL330-M288", 1210: "XC330-T181", 1220: "XC330-T288"},
    mode_items=("operating_mode",),
    modes=_MODES_X,
    fast_firmware=46,
    items=_x_items(
        {
            "temperature_limit": 70,
            "max_voltage_limit": 70,
            "min_voltage_limit": 35,
            "velocity_limit": 445,
            "shutdown": 53,
            "velocity_i_gain": 1600,
            "velocity_p_gain": 180,
            "position_d_gain": 0,
            "position_i_gain": 0,
            "position_p_gain": 400,
        },
        highs={"protocol_type": 22, "baud_rate": 6},
        own=(
            *_current_items(1750, "milliampere"),
            _STARTUP,
            Item("pwm_slope", 62, 1, "RW", "E", 1, _BYTE, 140, "pwm_slope"),
        ),
    ),
)

XL430: Final = Table(
    name="XL430",
    protocol=2,
    models={1060: "XL430-W250", 1070: "XC430-W150"},
    mode_items=("operating_mode",),
    modes={key: mode for key, mode in _MODES_X.items() if key not in {0, 5}},
    fast_firmware=45,
    items=_x_items(
        {
            "temperature_limit": 72,
            "max_voltage_limit": 140,
            "min_voltage_limit": 60,
            "velocity_limit": 265,
            "shutdown": 52,
            "velocity_i_gain": 1000,
            "velocity_p_gain": 100,
            "position_d_gain": 4000,
            "position_i_gain": 0,
            "position_p_gain": 640,
        },
        own=(_STARTUP, Item("present_load", 126, 2, "R", "R", -1000, 1000, None, "x_load")),
    ),
)

XM430: Final = Table(
    name="XM430",
    protocol=2,
    models={1020: "XM430-W350", 1030: "XM430-W210"},
    mode_items=("operating_mode",),
    modes=_MODES_X,
    fast_firmware=45,
    items=_x_items(
        {
            "temperature_limit": 80,
            "max_voltage_limit": 160,
            "min_voltage_limit": 95,
            "velocity_limit": 350,
            "shutdown": 52,
            "velocity_i_gain": 1920,
            "velocity_p_gain": 100,
            "position_d_gain": 0,
            "position_i_gain": 0,
            "position_p_gain": 800,
        },
        own=(
            *_current_items(1193, "xm_current"),
            Item("acceleration_limit", 40, 4, "RW", "E", 0, 32767, 32767, "x_acceleration"),
        ),
    ),
)

TABLES: Final = (AX12, AXS1, XL330, XL430, XM430)
MODELS: Final = {model: table for table in TABLES for model in table.models}


def table_of(model: int) -> Table | None:
    """Return the control table of a model number, None for a model we have no table of."""
    return MODELS.get(model)
