"""What the registers of a servo mean for its health, in SI units, with the range that its maker allows.

The range of temperature and voltage is that of the model: the factory values of the registers of its limits.
"""

from __future__ import annotations

import math
from typing import Any, Final

from urbihw.buses.readings import ALARM, Reading
from urbihw.buses.servos import units
from urbihw.buses.servos.alarms import NO_TORQUE_LIMIT, advised
from urbihw.buses.servos.cycle import STATE_ITEM
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.item import ControlTable, Item
from urbihw.buses.servos.status import state_words

_MEASURED: Final = {
    "present_position": "position",
    "present_speed": "speed",
    "present_velocity": "speed",
    "present_load": "load",
    "present_current": "current",
    "present_voltage": "voltage",
    "present_input_voltage": "voltage",
    "present_temperature": "temperature",
}
_RANGES: Final = {
    "temperature": ("", "temperature_limit"),
    "voltage": ("min_voltage_limit", "max_voltage_limit"),
}
"""Quantity -> the registers of its lowest and its highest value, "" for none."""
HARDWARE_ERROR: Final = "hardware_error"
"""The register with the causes of an alert, in protocol 2.0."""
_EFFECTORS: Final = {"rad": "position", "rad/s": "speed", "A": "current"}
"""SI unit of the target that moves a servo -> quantity; a share of the full drive is "load"."""


def reading_of(device: ServoDevice, item: str, raw: Any) -> Reading | None:
    """Return the reading of a register; None for those that tell nothing of the health."""
    table, mode = device.table, device.mode
    if table is not None and table.hardware_errors:
        # This register has the cause; the bit in the answers only says that there is one.
        if item == HARDWARE_ERROR:
            return Reading(ALARM, advised(table.error_words(raw), f"motor{device.id}.reboot"))
        if item == STATE_ITEM:
            return None
    elif item == STATE_ITEM:
        words = state_words(raw, device.protocol)
        if table is None or not table.has_motor:
            return Reading(ALARM, words)
        return Reading(ALARM, advised(words, f"motor{device.id}.load = 1"))
    if table is None or item not in table.items:
        return None
    if item == "torque_limit" and table.protocol == 1 and not table.hardware_errors and device.protocol == 1:
        return Reading(ALARM, "" if raw else advised(NO_TORQUE_LIMIT, f"motor{device.id}.load = 1"))
    found = table.items[item]
    wheel = mode is not None and mode.name == "wheel"
    quantity = _MEASURED.get(item, "")
    if not quantity and mode is not None and mode.effector == item:
        quantity = _EFFECTORS.get(units.unit_of(found, wheel).symbol, "load")
    if not quantity:
        return None
    value, symbol = units.to_si(found, raw, wheel), units.unit_of(found, wheel).symbol
    low, high = _RANGES.get(quantity, ("", ""))
    return Reading(quantity, value, symbol, _default(table, low), _default(table, high))


def _default(table: ControlTable, name: str) -> float:
    """The factory value of a register; nan if it has none, and for no register."""
    item: Item | None = table.items.get(name)
    return math.nan if item is None or item.default is None else units.to_si(item, item.default)
