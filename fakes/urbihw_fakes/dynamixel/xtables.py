"""X series: the differences of the models, and the control table computed from them.

Source: the e-manual pages of the models named here; stall currents and no-load speeds behind them are model choices.
Only rows of the project's sheet are here; MX(2.0) and XW have, unlike real ones, the rows of XM430.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from urbihw_fakes.dynamixel.registers import Register

CURRENT, VELOCITY, POSITION, EXTENDED, CURRENT_POSITION, PWM = 0, 1, 3, 4, 5, 16
FULL_PWM = 885  # 100 %
STEPS = 4096  # of one turn
MAX_TURNS = 256


@dataclass(frozen=True, slots=True)
class Model:
    """The data of one model; voltages in 0.1 V, velocity in 0.229 rpm, current in the unit of register 38."""

    number: int
    firmware: int
    temperature_limit: int
    max_voltage: int
    min_voltage: int
    velocity_limit: int
    current_limit: int | None  # None: no current control, register 126 shows the load in 0.1 % instead
    stall: int  # register 126 at stall
    shutdown: int
    velocity_gains: tuple[int, int]  # I, P
    position_gains: tuple[int, int, int]  # D, I, P
    volts: float  # nominal supply
    acceleration_limit: bool = False
    small: bool = False  # X330: fewer indirect entries at other places, no 4.5 Mbps

    @property
    def modes(self) -> frozenset[int]:
        """The operating modes of the model."""
        modes = frozenset({VELOCITY, POSITION, EXTENDED, PWM})
        return modes if self.current_limit is None else modes | {CURRENT, CURRENT_POSITION}

    @property
    def indirect(self) -> tuple[tuple[int, int, int], ...]:
        """Indirect areas: (first address entry, first data byte, entries)."""
        return ((168, 208, 20),) if self.small else ((168, 224, 28), (578, 634, 28))


_XL330 = Model(1200, 47, 70, 70, 35, 445, 1750, 1470, 53, (1600, 180), (0, 0, 400), 5.0, small=True)
_XL430 = Model(1060, 45, 72, 140, 60, 265, None, 1000, 52, (1000, 100), (4000, 0, 640), 12.0)
_XM430 = Model(1020, 45, 80, 160, 95, 350, 1193, 855, 52, (1920, 100), (0, 0, 800), 12.0, acceleration_limit=True)
_XC330 = replace(
    _XL330, number=1220, max_voltage=140, min_voltage=55, velocity_limit=320, current_limit=910, stall=800, volts=12.0
)
_XH430V = replace(_XM430, number=1040, max_voltage=300, min_voltage=110, current_limit=689, stall=522, volts=24.0)
_XM540 = replace(_XM430, velocity_limit=128, current_limit=2047, stall=1636, acceleration_limit=False)
_MX28 = Model(30, 42, 80, 160, 95, 380, None, 1000, 52, (1920, 100), (0, 0, 850), 12.0, acceleration_limit=True)

MODELS = {
    "XL330-M288": _XL330,
    "XL330-M077": replace(_XL330, number=1190),
    "XL430-W250": _XL430,
    "XM430-W350": _XM430,
    "XM430-W210": replace(_XM430, number=1030),
    "XC330-T288": _XC330,
    "XC430-W150": replace(_XL430, number=1070),
    "2XL430-W250": replace(_XL430, number=1090, firmware=44, velocity_limit=250),
    "XM540-W270": replace(_XM540, number=1120),
    "XH430-W350": replace(_XM430, number=1000, current_limit=648, stall=500),
    "XH430-V350": _XH430V,
    "XH540-W270": replace(_XM540, number=1100, velocity_limit=167),
    "XW540-T260": replace(_XM540, number=1170, velocity_limit=167),
    "MX-28(2.0)": replace(_MX28, number=30),
    "MX-64(2.0)": replace(_MX28, number=311, velocity_limit=435, current_limit=1941, stall=1220),
    "MX-106(2.0)": replace(_MX28, number=321, velocity_limit=360, current_limit=2047, stall=1548),
}


def _rom(name: str, address: int, size: int, default: int = 0) -> Register:
    return Register(name, address, size, default, writable=False, eeprom=True)


def _kept(name: str, address: int, size: int, default: int, low: int, high: int) -> Register:
    """Return a row of the EEPROM; it is signed if its lowest value is negative."""
    return Register(name, address, size, default, low, high, eeprom=True, signed=low < 0)


def _live(name: str, address: int, size: int, default: int, low: int, high: int) -> Register:
    return Register(name, address, size, default, low, high, signed=low < 0)


def _seen(name: str, address: int, size: int, signed: bool = False) -> Register:
    return Register(name, address, size, writable=False, signed=signed)


def table(model: Model) -> list[Register]:
    """Return the control table of a model."""
    rows = [*_eeprom(model), *_ram(model), *_present()]
    for area, (entries, data, count) in enumerate(model.indirect):
        for index in range(count):
            where = f"{area}_{index}"
            address = entries + 2 * index
            rows.append(_live(f"indirect_address_{where}", address, 2, data + index, 0, 0xFFFF))
            rows.append(_live(f"indirect_data_{where}", data + index, 1, 0, 0, 0xFF))
    return rows


def _eeprom(model: Model) -> list[Register]:
    rows = [
        _rom("model", 0, 2, model.number),
        _rom("model_information", 2, 4),
        _rom("firmware", 6, 1, model.firmware),
        _kept("id", 7, 1, 1, 0, 252),
        _kept("baud", 8, 1, 1, 0, 6 if model.small else 7),
        _kept("return_delay", 9, 1, 250, 0, 254),
        _kept("drive_mode", 10, 1, 0, 0, 0x0D),
        _kept("operating_mode", 11, 1, POSITION, 0, 16),
        _kept("secondary_id", 12, 1, 255, 0, 255),
        _kept("protocol", 13, 1, 2, 2, 2),
        _kept("homing_offset", 20, 4, 0, -1_044_479, 1_044_479),
        _kept("moving_threshold", 24, 4, 10, 0, 1023),
        _kept("temperature_limit", 31, 1, model.temperature_limit, 0, 100),
        _kept("max_voltage", 32, 2, model.max_voltage, model.min_voltage, model.max_voltage),
        _kept("min_voltage", 34, 2, model.min_voltage, model.min_voltage, model.max_voltage),
        _kept("pwm_limit", 36, 2, FULL_PWM, 0, FULL_PWM),
        _kept("velocity_limit", 44, 4, model.velocity_limit, 0, 2047 if model.small else 1023),
        _kept("max_position", 48, 4, STEPS - 1, 0, STEPS - 1),
        _kept("min_position", 52, 4, 0, 0, STEPS - 1),
        _kept("startup", 60, 1, 0, 0, 3),
        _kept("shutdown", 63, 1, model.shutdown, 0, 0x3D),
    ]
    if model.current_limit is not None:
        rows.append(_kept("current_limit", 38, 2, model.current_limit, 0, model.current_limit))
    if model.acceleration_limit:
        rows.append(_kept("acceleration_limit", 40, 4, 32767, 0, 32767))
    if model.small:
        rows.append(_kept("pwm_slope", 62, 1, 140, 1, 255))
    return rows


def _ram(model: Model) -> list[Register]:
    velocity_i, velocity_p = model.velocity_gains
    position_d, position_i, position_p = model.position_gains
    turns = MAX_TURNS * STEPS
    rows = [
        _live("torque_enable", 64, 1, 0, 0, 1),
        _live("led", 65, 1, 0, 0, 1),
        _live("status_level", 68, 1, 2, 0, 2),
        _seen("registered", 69, 1),
        _seen("hardware_error", 70, 1),
        _live("velocity_i", 76, 2, velocity_i, 0, 16383),
        _live("velocity_p", 78, 2, velocity_p, 0, 16383),
        _live("position_d", 80, 2, position_d, 0, 16383),
        _live("position_i", 82, 2, position_i, 0, 16383),
        _live("position_p", 84, 2, position_p, 0, 16383),
        _live("feedforward_2", 88, 2, 0, 0, 16383),
        _live("feedforward_1", 90, 2, 0, 0, 16383),
        _live("bus_watchdog", 98, 1, 0, -1, 127),
        _live("goal_pwm", 100, 2, FULL_PWM, -FULL_PWM, FULL_PWM),
        _live("goal_velocity", 104, 4, 0, -2047, 2047),
        _live("profile_acceleration", 108, 4, 0, 0, 32767),
        _live("profile_velocity", 112, 4, 0, 0, 32767),
        _live("goal_position", 116, 4, 0, -turns, turns - 1),
    ]
    if model.current_limit is not None:
        limit = model.current_limit
        rows.append(_live("goal_current", 102, 2, limit, -limit, limit))
    return rows


def _present() -> list[Register]:
    return [
        _seen("realtime_tick", 120, 2),
        _seen("moving", 122, 1),
        _seen("moving_status", 123, 1),
        _seen("present_pwm", 124, 2, signed=True),
        _seen("present_current", 126, 2, signed=True),
        _seen("present_velocity", 128, 4, signed=True),
        _seen("present_position", 132, 4, signed=True),
        _seen("velocity_trajectory", 136, 4, signed=True),
        _seen("position_trajectory", 140, 4, signed=True),
        _seen("present_voltage", 144, 2),
        _seen("present_temperature", 146, 1),
        _seen("backup_ready", 147, 1),
    ]
