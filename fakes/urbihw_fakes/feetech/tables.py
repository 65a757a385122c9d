"""Memory tables of Feetech servos: the registers of STS3215, STS3250 and SM8512BL, and those of SCS0009 and SCS15.

Sources: translated memory table of the STS3215 (firmware 3.6) and of the SCSCL; the vendor's headers SMS_STS.h and
SCSCL.h; rustypot's scs0009.rs. Choices where they are silent: the model number of SCS15 (unknown: here 1540, which
another SCS servo reported), the voltage limits of the 12 V models, lock 1 at power-on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from urbihw_fakes.dynamixel.registers import Register


@dataclass(frozen=True, slots=True)
class Row(Register):
    """A register; `sign` is the bit with the sign of a sign-magnitude number, None for a plain number."""

    sign: int | None = None

    @property
    def bounds(self) -> tuple[int, int]:
        """The range of values: as given, else that of the size and sign."""
        high = (1 << (8 * self.size if self.sign is None else self.sign)) - 1
        low = 0 if self.sign is None else -high
        return (low if self.low is None else self.low, high if self.high is None else self.high)


def _e(name: str, address: int, size: int, default: int, high: int, low: int = 0, sign: int | None = None) -> Row:
    """Return a row of the EEPROM."""
    return Row(name, address, size, default, low, high, True, True, False, sign)


def _r(name: str, address: int, size: int, default: int, high: int, low: int = 0, sign: int | None = None) -> Row:
    """Return a row of the RAM."""
    return Row(name, address, size, default, low, high, True, False, False, sign)


def _fixed(name: str, address: int, size: int, value: int) -> Row:
    """Return a read-only row of the EEPROM."""
    return Row(name, address, size, value, None, None, False, True)


def _sensed(name: str, address: int, size: int, sign: int | None = None) -> Row:
    """Return a read-only row of the RAM."""
    return Row(name, address, size, 0, None, None, False, False, False, sign)


def _sts(model: int, max_voltage: int) -> tuple[Row, ...]:
    return (
        _fixed("firmware_major", 0, 1, 3),
        _fixed("firmware_minor", 1, 1, 10),
        _fixed("end", 2, 1, 0),
        _fixed("model", 3, 2, model),
        _e("id", 5, 1, 1, 253),
        _e("baud", 6, 1, 0, 7),
        _e("return_delay", 7, 1, 0, 254),
        _e("response_level", 8, 1, 1, 1),
        _e("min_angle", 9, 2, 0, 4094),
        _e("max_angle", 11, 2, 4095, 4095),
        _e("max_temperature", 13, 1, 70, 100),
        _e("max_voltage", 14, 1, max_voltage, 254),
        _e("min_voltage", 15, 1, 40, 254),
        _e("max_torque", 16, 2, 1000, 1000),
        _e("phase", 18, 1, 12, 255),
        _e("unloading", 19, 1, 44, 255),
        _e("led_alarm", 20, 1, 47, 255),
        _e("position_p", 21, 1, 32, 254),
        _e("position_d", 22, 1, 32, 254),
        _e("position_i", 23, 1, 0, 254),
        _e("start_force", 24, 2, 16, 1000),
        _e("cw_dead_zone", 26, 1, 1, 32),
        _e("ccw_dead_zone", 27, 1, 1, 32),
        _e("protection_current", 28, 2, 500, 511),
        _e("resolution", 30, 1, 1, 100, 1),
        _e("offset", 31, 2, 0, 2047, -2047, 11),
        _e("mode", 33, 1, 0, 3),
        _e("protective_torque", 34, 1, 20, 100),
        _e("protection_time", 35, 1, 200, 254),
        _e("overload_torque", 36, 1, 80, 100),
        _e("speed_p", 37, 1, 10, 100),
        _e("overcurrent_time", 38, 1, 200, 254),
        _e("speed_i", 39, 1, 10, 254),
        _r("torque", 40, 1, 0, 128),
        _r("acceleration", 41, 1, 0, 254),
        _r("goal_position", 42, 2, 0, 32766, -32766, 15),
        _r("goal_pwm", 44, 2, 0, 1000, -1000, 10),
        _r("goal_speed", 46, 2, 0, 32767, -32767, 15),
        _r("torque_limit", 48, 2, 1000, 1000),
        _r("lock", 55, 1, 1, 1),
        _sensed("present_position", 56, 2, 15),
        _sensed("present_speed", 58, 2, 15),
        _sensed("present_load", 60, 2, 10),
        _sensed("present_voltage", 62, 1),
        _sensed("present_temperature", 63, 1),
        _sensed("async_write", 64, 1),
        _sensed("status", 65, 1),
        _sensed("moving", 66, 1),
        _sensed("present_current", 69, 2),
        _sensed("second_goal", 71, 2),
        _e("moving_threshold", 80, 1, 20, 255),
        _e("dts", 81, 1, 10, 255),
        _e("speed_unit", 82, 1, 1, 255),
        _e("hts", 83, 1, 20, 255),
        _e("max_speed", 84, 1, 254, 255),
        _e("max_acceleration", 85, 1, 254, 255),
        _e("acceleration_factor", 86, 1, 1, 255),
    )


def _scs(model: int, max_voltage: int) -> tuple[Row, ...]:
    return (
        _fixed("firmware_major", 0, 1, 2),
        _fixed("firmware_minor", 1, 1, 7),
        _fixed("end", 2, 1, 1),
        _fixed("model", 3, 2, model),
        _e("id", 5, 1, 1, 253),
        _e("baud", 6, 1, 0, 7),
        _e("return_delay", 7, 1, 0, 254),
        _e("response_level", 8, 1, 1, 1),
        _e("min_angle", 9, 2, 20, 1023),
        _e("max_angle", 11, 2, 1003, 1023),
        _e("max_temperature", 13, 1, 80, 100),
        _e("max_voltage", 14, 1, max_voltage, 254),
        _e("min_voltage", 15, 1, 40, 254),
        _e("max_torque", 16, 2, 1000, 1023),
        _e("phase", 18, 1, 8, 255),
        _e("unloading", 19, 1, 37, 255),
        _e("led_alarm", 20, 1, 37, 255),
        _e("position_p", 21, 1, 15, 254),
        _e("position_d", 22, 1, 0, 254),
        _e("position_i", 23, 1, 0, 254),
        _e("start_force", 24, 2, 0, 1000),
        _e("cw_dead_zone", 26, 1, 2, 32),
        _e("ccw_dead_zone", 27, 1, 2, 32),
        _e("protective_torque", 37, 1, 40, 100),
        _e("protection_time", 38, 1, 200, 254),
        _e("overload_torque", 39, 1, 80, 100),
        _r("torque", 40, 1, 0, 1),
        _r("goal_position", 42, 2, 0, 1023),
        _r("goal_time", 44, 2, 0, 1023, -1023, 10),
        _r("goal_speed", 46, 2, 0, 4095),
        _r("lock", 48, 1, 1, 1),
        _sensed("present_position", 56, 2),
        _sensed("present_speed", 58, 2, 15),
        _sensed("present_load", 60, 2, 10),
        _sensed("present_voltage", 62, 1),
        _sensed("present_temperature", 63, 1),
        _sensed("async_write", 64, 1),
        _sensed("status", 65, 1),
        _sensed("moving", 66, 1),
        _sensed("present_current", 69, 2),
    )


@dataclass(frozen=True, slots=True)
class Model:
    """One model: its registers, its series, and the numbers of its motor.

    Attributes:
        rows: its memory table.
        series: "STS" or "SCS".
        volts: supply it is made for.
        full_speed: steps/s without load at that supply (STS3215: 0.222 s for 60 degrees; SCS0009: 0.1 s; else choices).
        stall_current: current at full drive, in the servo's units of 6.5 mA.
    """

    rows: tuple[Row, ...]
    series: str
    volts: float
    full_speed: float
    stall_current: int


MODELS: Final = {
    "STS3215": Model(_sts(777, 80), "STS", 7.4, 3073.0, 415),
    "STS3250": Model(_sts(2825, 140), "STS", 12.0, 5130.0, 480),
    "SM8512BL": Model(_sts(11272, 140), "STS", 12.0, 3400.0, 480),
    "SCS0009": Model(_scs(1284, 84), "SCS", 6.0, 2048.0, 150),
    "SCS15": Model(_scs(1540, 84), "SCS", 7.4, 1600.0, 300),
}
