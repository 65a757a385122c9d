"""The slots of each device: register, unit, and reading period.

Registers are named as in ``urbihw.buses.servos.tables``; their SI values come from ``units``.  A ``View`` converts
them where the slot is something else: a torque in N m instead of a fraction, or a boolean.

Torques are estimates: the AX-12 and the XL430 report the share of full drive, not a force; others report a current.
Sources: slots, the manual's Bioloid chapter; registers, ROBOTIS e-manual (ax-12a, ax-s1, xl330-m288, xl430-w250,
xm430-w350); stall torques and speeds, the "Specifications" tables there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

FAST: Final = 0.0
"""Seconds between readings: every tick."""
MEDIUM: Final = 0.1
SLOW: Final = 1.0
RARE: Final = 10.0


@dataclass(frozen=True, slots=True)
class Facts:
    """Data of a model from its data sheet, at nominal voltage.

    Attributes:
        stall_torque: N m.
        stall_current: A; nan where the model does not measure its current.
        full_speed: rad/s without load.
    """

    stall_torque: float
    stall_current: float
    full_speed: float


_RPM = math.tau / 60
_NONE: Final = Facts(1.0, math.nan, math.nan)
FACTS: Final = {
    "AX-12A": Facts(1.5, math.nan, 59 * _RPM),  # 12 V
    "AX-18A": Facts(1.8, math.nan, 97 * _RPM),  # 12 V
    # The maker gives no torque; the motor is that of the AX-12A behind a gear of 32:1 instead of 254:1.
    "AX-12W": Facts(1.5 * 32 / 254, math.nan, 470 * _RPM),
    "XL330-M077": Facts(0.215, 1.47, 383 * _RPM),  # 5 V
    "XL330-M288": Facts(0.52, 1.47, 103 * _RPM),  # 5 V
    "XC330-T181": Facts(0.80, 0.88, 113 * _RPM),  # 12 V
    "XC330-T288": Facts(1.00, 0.88, 71 * _RPM),  # 12 V
    "XL430-W250": Facts(1.5, math.nan, 61 * _RPM),  # 12 V
    "XC430-W150": Facts(1.6, math.nan, 106 * _RPM),  # 12 V
    "XM430-W210": Facts(3.0, 2.3, 77 * _RPM),  # 12 V
    "XM430-W350": Facts(4.1, 2.3, 46 * _RPM),  # 12 V
}


def facts_of(model: str) -> Facts:
    """Return the data of a model by name; torques of an unknown one are fractions of full torque."""
    return FACTS.get(model, _NONE)


@dataclass(frozen=True, slots=True)
class View:
    """Conversion between the SI value of a register and the slot: ``show(si, facts)`` and ``to_si(value, facts)``.

    ``unit`` is the unit of the slot, "" for that of the register.
    """

    show: Callable[[float, Facts], Any]
    to_si: Callable[[float, Facts], float]
    unit: str = ""


def _same(value: float, facts: Facts) -> float:
    return value


def bit(number: int) -> View:
    """One bit of a register, as a truth value."""
    return View(lambda si, facts: bool(int(si) >> number & 1), _same)


PLAIN: Final = View(_same, _same)
FLAG: Final = View(lambda si, facts: bool(si), _same)
TORQUE: Final = View(lambda si, facts: si * facts.stall_torque, lambda value, facts: value / facts.stall_torque, "N m")
CURRENT_TORQUE: Final = View(
    lambda si, facts: si / facts.stall_current * facts.stall_torque,
    lambda value, facts: value / facts.stall_torque * facts.stall_current,
    "N m",
)
_SILENCE = 127.5
# The microphone swings around 127.5: its volume is the size of the swing, 0..1.
VOLUME: Final = View(lambda si, facts: abs(si - _SILENCE) / _SILENCE, _same)
# The largest sample so far; 0 restarts it.
LOUDEST: Final = View(
    lambda si, facts: max(0.0, si - _SILENCE) / _SILENCE,
    lambda value, facts: 0.0 if value == 0 else _SILENCE + value * _SILENCE,
)


class Kind(Enum):
    """The effect of a write to a slot."""

    READ = "refused"
    SETTING = "written with the next tick, set again when the device comes back"
    ALWAYS = "as a setting, but also when it should have that value: the device changes it by itself"
    COUNTER = "written at once, not set again when the device comes back"
    KEPT = "written if it differs: it lasts without power, and wears out"
    OWN = "what the class of the device does"


@dataclass(frozen=True, slots=True)
class Slot:
    """One row: the register ``item`` seen as the slot ``name``."""

    name: str
    item: str
    pace: float
    kind: Kind = Kind.READ
    view: View = PLAIN


_COMMON: Final = (
    Slot("voltage", "present_voltage", SLOW),
    Slot("temperature", "present_temperature", SLOW),
    Slot("temperatureLimit", "temperature_limit", RARE, Kind.KEPT),
    Slot("minVoltage", "min_voltage_limit", RARE, Kind.KEPT),
    Slot("maxVoltage", "max_voltage_limit", RARE, Kind.KEPT),
    Slot("returnDelay", "return_delay_time", RARE, Kind.KEPT),
    Slot("statusReturnLevel", "status_return_level", RARE),
    Slot("baudRate", "baud_rate", RARE),
)
_SERVO: Final = (
    *_COMMON,
    Slot("val", "present_position", FAST, Kind.OWN),
    Slot("moving", "moving", MEDIUM, view=FLAG),
    Slot("led", "led", SLOW, Kind.SETTING),
    Slot("load", "torque_enable", MEDIUM, Kind.OWN),
    Slot("shutdown", "shutdown", RARE, Kind.KEPT),
)

AX12: Final = (
    *_SERVO,
    Slot("speed", "present_speed", FAST, Kind.OWN),
    Slot("torque", "present_load", FAST, view=TORQUE),
    Slot("cwLimit", "cw_angle_limit", RARE, Kind.OWN),
    Slot("ccwLimit", "ccw_angle_limit", RARE, Kind.OWN),
    Slot("torqueLimit", "torque_limit", MEDIUM, Kind.ALWAYS, TORQUE),
    Slot("maxTorque", "max_torque", RARE, Kind.KEPT, TORQUE),
    Slot("cwComplianceMargin", "cw_compliance_margin", SLOW, Kind.SETTING),
    Slot("ccwComplianceMargin", "ccw_compliance_margin", SLOW, Kind.SETTING),
    Slot("cwComplianceSlope", "cw_compliance_slope", SLOW, Kind.SETTING),
    Slot("ccwComplianceSlope", "ccw_compliance_slope", SLOW, Kind.SETTING),
    Slot("punch", "punch", SLOW, Kind.SETTING, TORQUE),
    Slot("alarmLed", "alarm_led", RARE, Kind.KEPT),
    Slot("lock", "lock", SLOW, Kind.COUNTER),
)

AXS1: Final = (
    *_COMMON,
    Slot("IRLeft", "ir_left", FAST),
    Slot("IRCenter", "ir_center", FAST),
    Slot("IRRight", "ir_right", FAST),
    Slot("lightLeft", "light_left", FAST),
    Slot("lightCenter", "light_center", FAST),
    Slot("lightRight", "light_right", FAST),
    Slot("obstacleLeft", "obstacle_detected", FAST, view=bit(0)),
    Slot("obstacleCenter", "obstacle_detected", FAST, view=bit(1)),
    Slot("obstacleRight", "obstacle_detected", FAST, view=bit(2)),
    Slot("lightDetectedLeft", "light_detected", FAST, view=bit(0)),
    Slot("lightDetectedCenter", "light_detected", FAST, view=bit(1)),
    Slot("lightDetectedRight", "light_detected", FAST, view=bit(2)),
    Slot("soundVolume", "sound", FAST, view=VOLUME),
    Slot("soundVolumeMax", "sound_max_hold", FAST, Kind.COUNTER, LOUDEST),
    Slot("clapCount", "sound_count", FAST, Kind.OWN),
    Slot("soundTime", "sound_time", FAST, Kind.COUNTER),
    Slot("obstacleThreshold", "obstacle_compare", SLOW, Kind.SETTING),
    Slot("lightThreshold", "light_compare", SLOW, Kind.SETTING),
    Slot("obstacleThresholdDefault", "obstacle_threshold", RARE, Kind.KEPT),
    Slot("lightThresholdDefault", "light_threshold", RARE, Kind.KEPT),
    Slot("lock", "lock", SLOW, Kind.COUNTER),
)

_X: Final = (
    *_SERVO,
    Slot("speed", "present_velocity", FAST, Kind.OWN),
    Slot("cwLimit", "min_position_limit", RARE, Kind.OWN),
    Slot("ccwLimit", "max_position_limit", RARE, Kind.OWN),
    Slot("torqueLimit", "goal_pwm", SLOW, Kind.SETTING, TORQUE),
    Slot("maxTorque", "pwm_limit", RARE, Kind.KEPT, TORQUE),
    Slot("positionPGain", "position_p_gain", SLOW, Kind.SETTING),
    Slot("positionIGain", "position_i_gain", SLOW, Kind.SETTING),
    Slot("positionDGain", "position_d_gain", SLOW, Kind.SETTING),
    Slot("acceleration", "profile_acceleration", SLOW, Kind.SETTING),
    Slot("homingOffset", "homing_offset", RARE, Kind.KEPT),
)
XL430: Final = (*_X, Slot("torque", "present_load", FAST, view=TORQUE))
X_CURRENT: Final = (*_X, Slot("torque", "present_current", FAST, view=CURRENT_TORQUE))
