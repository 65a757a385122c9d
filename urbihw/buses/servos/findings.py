"""What is wrong with a servo as a survey found it, and what that costs in the cycle; no I/O.

The cost is the time that the cycle of the worker loses by it: a return delay is waited for at each answer.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from urbihw.buses.servos import units
from urbihw.buses.servos.item import ControlTable, ShaftMotion
from urbihw.buses.servos.registers import ANSWER_LEVELS
from urbihw.buses.servos.status import FEETECH, state_words
from urbihw.buses.servos.survey import SurveyedServo
from urbihw.frozen import frozen

_BITS_PER_BYTE: Final = 10
_READ_BYTES: Final = {1: 8 + 6 + 8, 2: 1 + 11 + 10, FEETECH: 1 + 6 + 8}
"""Bytes of reading the motion of a servo: a READ of 8 bytes in protocol 1.0, its share of a SYNC READ elsewhere."""
_NARROW: Final = math.radians(30)
_SLOW_DELAY: Final = 100e-6
"""Seconds of return delay above which it is worth a line."""


@frozen(slots=False)
class ServoFinding:
    """One thing that is wrong.

    Attributes:
        text: what, and what to do.
        cost: seconds of each cycle that it takes, 0 if it costs none.
    """

    text: str
    cost: float = 0.0


def cycle_time(servo: SurveyedServo, latency: float = 0.0) -> float:
    """Return the seconds that reading a servo takes in each cycle; `latency`: of the adapter, for each answer."""
    wire = _READ_BYTES[servo.device.protocol] * _BITS_PER_BYTE / servo.baud
    return wire + _return_delay(servo) + latency


def findings(servo: SurveyedServo) -> list[ServoFinding]:
    """Return what is wrong with a servo."""
    table = servo.device.table
    found = [*_alarms(servo), *_answers(servo)]
    if table is not None:
        found += [*_voltage(servo, table), *_limits(servo, table)]
    return found


def _return_delay(servo: SurveyedServo) -> float:
    table, raw = servo.device.table, servo.values.get("return_delay_time")
    return 0.0 if table is None or raw is None else units.to_si(table.item("return_delay_time"), raw)


def _alarms(servo: SurveyedServo) -> Iterator[ServoFinding]:
    error = servo.values.get("hardware_error", 0)
    if error:
        words = servo.device.table.error_words(error) if servo.device.table else f"0x{error:02X}"
        yield ServoFinding(f"hardware error ({words}): mend the cause, then urbihw servo reboot")
    elif servo.state:
        yield ServoFinding(f"alarm: {state_words(servo.state, servo.device.protocol)}")
    if servo.values.get("torque_limit") == 0:
        yield ServoFinding("torque limit 0: it has shut itself down; mend the cause, then switch it off and on")


def _answers(servo: SurveyedServo) -> Iterator[ServoFinding]:
    delay = _return_delay(servo)
    if delay > _SLOW_DELAY:
        raw = servo.values["return_delay_time"]
        yield ServoFinding(f"return delay {raw}: set return_delay_time to 0", delay)
    if servo.device.model == 0:
        yield ServoFinding("status return level 0: it answers pings only and cannot be read")
    table = servo.device.table
    for name in ANSWER_LEVELS:
        level = servo.values.get(name)
        if table is not None and name in table.items and level is not None and level < table.item(name).high:
            words = name.replace("_", " ")
            yield ServoFinding(f"{words} {level}: writes are not confirmed; set {name} to {table.item(name).high}")


def _voltage(servo: SurveyedServo, table: ControlTable) -> Iterator[ServoFinding]:
    names = ("min_voltage_limit", "present_voltage", "max_voltage_limit")
    if any(name not in servo.values for name in names):
        return
    low, volts, high = (units.to_si(table.item(name), servo.values[name]) for name in names)
    if not low <= volts <= high:
        yield ServoFinding(f"voltage {volts:.1f} V is outside its limits {low:.1f}..{high:.1f} V: check the supply")


def _limits(servo: SurveyedServo, table: ControlTable) -> Iterator[ServoFinding]:
    mode = servo.device.mode
    if mode is None:
        return
    if mode.motion is ShaftMotion.RATE:
        yield ServoFinding(f"{mode.name} mode: it turns and is no joint")
        return
    if len(mode.limits) != 2 or any(name not in servo.values for name in mode.limits):
        return
    low, high = (units.to_si(table.item(name), servo.values[name]) for name in mode.limits)
    if high <= low:
        yield ServoFinding(f"{mode.limits[0]} is not below {mode.limits[1]}: it takes no goal")
    elif high - low < _NARROW:
        yield ServoFinding(f"narrow limits: it moves only from {low:.2f} to {high:.2f} rad ({', '.join(mode.limits)})")
