"""The lock of the EEPROM that some servos have, for the driver and for the tools of set-up.

A Feetech servo takes a write of its EEPROM at any time, and forgets it at power-off unless its lock register is 0. So
the lock is opened before and closed after it, also where it was found open: an open lock lets later writes wear out the
EEPROM. A servo that was given a new id is locked under the new one. The vendor asks for the torque to be off meanwhile:
the driver refuses the write otherwise, the tools switch the torque off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from urbihw.buses.errors import BadValue
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.item import ControlTable, Item
from urbihw.buses.servos.plan import TORQUE

Write = Callable[[Item, int], None]
"""Writes a raw value to a register of the servo."""


def open_lock(table: ControlTable, write: Write) -> bool:
    """Open the lock of the EEPROM; return whether there is one, to be closed afterwards. Raises what `write` does."""
    if table.eeprom_lock:
        write(table.item(table.eeprom_lock), 0)
    return bool(table.eeprom_lock)


def close_lock(table: ControlTable, write: Write) -> None:
    """Close the lock of the EEPROM of a model that has one. Raises what `write` does."""
    write(table.item(table.eeprom_lock), 1)


@contextmanager
def unlocked(table: ControlTable, item: Item, write: Write) -> Iterator[None]:
    """Keep the lock open for a write of `item` if that is in the EEPROM. Raises what `write` does."""
    if item.area != "E" or not open_lock(table, write):
        yield
        return
    try:
        yield
    finally:
        close_lock(table, write)


def write_register(bus: ServoBus, device: ServoDevice, item: Item, raw: int) -> None:
    """Write one register, of the EEPROM so that it is kept without power.

    Raises BadValue while the torque of a servo with a lock is on, and as `ServoBus.write`.
    """
    table, number = device.table, device.id

    def write(register: Item, value: int) -> None:
        bus.write(number, register.address, register.pack(value), device.answers_writes)

    if table is None:
        write(item, raw)
        return
    if item.area == "E" and table.eeprom_lock and _read(bus, number, table, TORQUE):
        raise BadValue(f"{item.name} of servo {number} can only be written while its torque is off")
    with unlocked(table, item, write):
        write(item, raw)
        number = _present_id(bus, device, item, raw)


def _present_id(bus: ServoBus, device: ServoDevice, item: Item, raw: int) -> int:
    """Return the id that the servo answers to after a write."""
    if item.name != "id":
        return device.id
    bus.protocols[raw] = device.protocol
    return raw


def _read(bus: ServoBus, number: int, table: ControlTable, name: str) -> int:
    item = table.item(name)
    return item.unpack(bus.read(number, item.address, item.size))
