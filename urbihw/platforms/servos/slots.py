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
from dataclasses import replace
from enum import Enum
from typing import Any, Final

from urbihw.buses.servos.item import ControlTable
from urbihw.frozen import frozen

ChangeHandler = Callable[[int, float], None]
"""Called with the new raw count of a register and its time."""
FAST: Final = 0.0
"""Seconds between readings: every tick."""
MEDIUM: Final = 0.1
SLOW: Final = 1.0
RARE: Final = 10.0


@frozen
class Facts:
    """Data of a model from its data sheet, at the voltage that the sheet names.

    Attributes:
        stall_torque: N m.
        stall_current: A; nan where the model does not measure its current.
        full_speed: rad/s without load.
    """

    stall_torque: float
    stall_current: float
    full_speed: float

    @property
    def is_known(self) -> bool:
        """Whether the data sheet of the model is known; without it torques are fractions."""
        return self is not _NONE


_RPM = math.tau / 60
# Torques are fractions; a wheel has the highest speed that the register of the present speed can tell (1023 counts).
_NONE: Final = Facts(1.0, math.nan, 1023 * math.radians(0.666))
FACTS: Final = {
    "AX-12A": Facts(1.5, math.nan, 59 * _RPM),  # 12 V
    "AX-18A": Facts(1.8, math.nan, 97 * _RPM),  # 12 V
    # The maker gives no torque; the motor is that of the AX-12A behind a gear of 32:1 instead of 254:1.
    "AX-12W": Facts(1.5 * 32 / 254, math.nan, 470 * _RPM),
    "RX-10": Facts(1.3, math.nan, 54 * _RPM),  # 12 V
    "RX-28": Facts(3.7, math.nan, 85 * _RPM),  # 18.5 V
    "RX-64": Facts(5.3, math.nan, 64 * _RPM),  # 18.5 V
    "EX-106+": Facts(10.9, math.nan, 91 * _RPM),  # 18.5 V
    "MX-28": Facts(2.5, 1.4, 55 * _RPM),  # 12 V
    "MX-28(2.0)": Facts(2.5, 1.4, 55 * _RPM),  # 12 V
    "MX-64": Facts(6.0, 4.1, 63 * _RPM),  # 12 V
    "MX-64(2.0)": Facts(6.0, 4.1, 63 * _RPM),  # 12 V
    "XL330-M077": Facts(0.215, 1.47, 383 * _RPM),  # 5 V
    "XL330-M288": Facts(0.52, 1.47, 103 * _RPM),  # 5 V
    "XC330-T181": Facts(0.80, 0.88, 113 * _RPM),  # 12 V
    "XC330-T288": Facts(1.00, 0.88, 71 * _RPM),  # 12 V
    "XL430-W250": Facts(1.5, math.nan, 61 * _RPM),  # 12 V
    "XC430-W150": Facts(1.6, math.nan, 106 * _RPM),  # 12 V
    "XM430-W210": Facts(3.0, 2.3, 77 * _RPM),  # 12 V
    "XM430-W350": Facts(4.1, 2.3, 46 * _RPM),  # 12 V
    "XW540-T260": Facts(9.5, 4.9, 40 * _RPM),  # 12 V
}


def facts_of(model: str) -> Facts:
    """Return the data of a model by name; torques of an unknown one are fractions of full torque."""
    return FACTS.get(model, _NONE)


@frozen
class View:
    """Conversion between the SI value of a register and the slot: ``show(si, facts)`` and ``to_si(value, facts)``.

    ``unit`` is the unit of the slot, "" for that of the register.
    """

    show: Callable[[float, Facts], Any]
    to_si: Callable[[float, Facts], float]
    unit: str = ""


def keep(value: float, facts: Facts) -> float:
    """Return the value as it is."""
    return value


PLAIN: Final = View(keep, keep)
FLAG: Final = View(lambda si, facts: bool(si), keep)
TORQUE: Final = View(lambda si, facts: si * facts.stall_torque, lambda value, facts: value / facts.stall_torque, "N m")
CURRENT_TORQUE: Final = View(
    lambda si, facts: si / facts.stall_current * facts.stall_torque,
    lambda value, facts: value / facts.stall_torque * facts.stall_current,
    "N m",
)


class Kind(Enum):
    """The effect of a write to a slot."""

    READ = "refused"
    SETTING = "written with the next tick, set again when the device comes back"
    ALWAYS = "as a setting, but also when it should have that value: the device changes it by itself"
    COUNTER = "written at once, not set again when the device comes back"
    KEPT = "written if it differs: it lasts without power, and wears out"
    OWN = "what the class of the device does"


@frozen
class RegisterSlot:
    """One row: the register ``item`` seen as the slot ``name``."""

    name: str
    item: str
    pace: float
    kind: Kind = Kind.READ
    view: View = PLAIN


COMMON: Final = (
    RegisterSlot("voltage", "present_voltage", SLOW),
    RegisterSlot("temperature", "present_temperature", SLOW),
    RegisterSlot("temperatureLimit", "temperature_limit", RARE, Kind.KEPT),
    RegisterSlot("minVoltage", "min_voltage_limit", RARE, Kind.KEPT),
    RegisterSlot("maxVoltage", "max_voltage_limit", RARE, Kind.KEPT),
    RegisterSlot("returnDelay", "return_delay_time", RARE, Kind.KEPT),
    RegisterSlot("statusReturnLevel", "status_return_level", RARE),
    RegisterSlot("baudRate", "baud_rate", RARE),
)
"""The slots of all devices."""

SERVO: Final = (
    *COMMON,
    RegisterSlot("val", "present_position", FAST, Kind.OWN),
    RegisterSlot("moving", "moving", MEDIUM, view=FLAG),
    RegisterSlot("led", "led", SLOW, Kind.SETTING),
    RegisterSlot("load", "torque_enable", MEDIUM, Kind.OWN),
    RegisterSlot("shutdown", "shutdown", RARE, Kind.KEPT),
    RegisterSlot("alarmLed", "alarm_led", RARE, Kind.KEPT),
    RegisterSlot("speed", "present_velocity", FAST, Kind.OWN),
    RegisterSlot("speed", "present_speed", FAST, Kind.OWN),
    RegisterSlot("torque", "present_load", FAST, view=TORQUE),
    RegisterSlot("torque", "present_current", FAST, view=CURRENT_TORQUE),
    RegisterSlot("current", "present_current", FAST),
    RegisterSlot("cwLimit", "min_position_limit", RARE, Kind.OWN),
    RegisterSlot("cwLimit", "cw_angle_limit", RARE, Kind.OWN),
    RegisterSlot("ccwLimit", "max_position_limit", RARE, Kind.OWN),
    RegisterSlot("ccwLimit", "ccw_angle_limit", RARE, Kind.OWN),
    RegisterSlot("torqueLimit", "torque_limit", MEDIUM, Kind.ALWAYS, TORQUE),
    RegisterSlot("torqueLimit", "goal_pwm", SLOW, Kind.SETTING, TORQUE),
    RegisterSlot("maxTorque", "max_torque", RARE, Kind.KEPT, TORQUE),
    RegisterSlot("maxTorque", "pwm_limit", RARE, Kind.KEPT, TORQUE),
    RegisterSlot("cwComplianceMargin", "cw_compliance_margin", SLOW, Kind.SETTING),
    RegisterSlot("ccwComplianceMargin", "ccw_compliance_margin", SLOW, Kind.SETTING),
    RegisterSlot("cwComplianceSlope", "cw_compliance_slope", SLOW, Kind.SETTING),
    RegisterSlot("ccwComplianceSlope", "ccw_compliance_slope", SLOW, Kind.SETTING),
    RegisterSlot("punch", "punch", SLOW, Kind.SETTING, TORQUE),
    RegisterSlot("goalCurrent", "goal_current", SLOW, Kind.OWN),
    RegisterSlot("goalPwm", "goal_pwm", SLOW, Kind.OWN),
    RegisterSlot("pGain", "position_p_gain", SLOW, Kind.SETTING),
    RegisterSlot("pGain", "p_gain", SLOW, Kind.SETTING),
    RegisterSlot("iGain", "position_i_gain", SLOW, Kind.SETTING),
    RegisterSlot("iGain", "i_gain", SLOW, Kind.SETTING),
    RegisterSlot("dGain", "position_d_gain", SLOW, Kind.SETTING),
    RegisterSlot("dGain", "d_gain", SLOW, Kind.SETTING),
    RegisterSlot("velocityPGain", "velocity_p_gain", SLOW, Kind.SETTING),
    RegisterSlot("velocityIGain", "velocity_i_gain", SLOW, Kind.SETTING),
    RegisterSlot("feedForward1", "feedforward_1st_gain", SLOW, Kind.SETTING),
    RegisterSlot("feedForward2", "feedforward_2nd_gain", SLOW, Kind.SETTING),
    RegisterSlot("acceleration", "profile_acceleration", SLOW, Kind.SETTING),
    RegisterSlot("acceleration", "goal_acceleration", SLOW, Kind.SETTING),
    RegisterSlot("acceleration", "acceleration", SLOW, Kind.SETTING),
    RegisterSlot("homingOffset", "homing_offset", RARE, Kind.KEPT),
    RegisterSlot("lock", "lock", SLOW, Kind.COUNTER),
)
"""All slots that a servo may have; several registers that may stand for a slot are in order of preference."""


def rows_of(table: ControlTable, rows: tuple[RegisterSlot, ...] = SERVO) -> tuple[RegisterSlot, ...]:
    """Return the rows whose registers a control table has, one for each slot; a register in EEPROM is ``KEPT``."""
    found: dict[str, RegisterSlot] = {}
    for row in rows:
        item = table.items.get(row.item)
        if item is None or row.name in found:
            continue
        if item.access == "R" and row.kind not in (Kind.READ, Kind.OWN):
            row = replace(row, kind=Kind.READ)
        elif item.area == "E" and row.kind in (Kind.SETTING, Kind.ALWAYS):
            row = replace(row, kind=Kind.KEPT)
        found[row.name] = row
    return tuple(found.values())
