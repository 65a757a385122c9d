"""The registers of one servo for set-up: read all, write and check; nothing here makes a servo move.

Before any write the torque is switched off, and it stays off. Goals, and switching the torque on, are refused. A
locked EEPROM is unlocked for the write and locked again (Feetech); that of an AX stays locked until it loses power,
which is reported. Every write is read back.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from urbihw.buses.errors import BadFrame, BadValue, BusError, BusTimeout, DeviceRefused
from urbihw.buses.link import Link
from urbihw.buses.servos import eeprom
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.item import ControlTable, Item
from urbihw.buses.servos.plan import TORQUE, Block, read_blocks

LOCK: Final = "lock"
STORE_TIME: Final = 0.02
"""Seconds that a servo may need to store a byte, in which it may be silent."""
_RETRIES: Final = 8
"""Attempts of a read: a busy computer must not look like a silent servo, and time does not matter here."""
OWN_COMMANDS: Final = {
    "id": "urbihw servo set-id", "baud_rate": "urbihw servo set-baud", LOCK: "no command: it is set as needed",
}  # fmt: skip
"""Registers that are not written by name -> what changes them."""
PINGS_ONLY: Final = "status_return_level"
"""The register with which a servo answers pings only, at 0. (The response_level 0 of a Feetech answers reads, too.)"""
ANSWER_LEVELS: Final = ("status_return_level", "response_level")
"""The registers with which a servo answers everything, at their highest value: Dynamixel, Feetech."""


class ServoError(BusError):
    """A set-up of a servo did not work; the message is one line: what happened, and what to do."""


class Crowded(ServoError):
    """More than one servo answers to an id.

    Attributes:
        number: the id.
    """

    def __init__(self, number: int) -> None:
        super().__init__(f"more than one servo answers to id {number}: unplug all of them but one")
        self.number = number


class PingsOnly(ServoError):
    """A servo answers nothing but pings.

    Attributes:
        device: what is known of it.
    """

    def __init__(self, device: ServoDevice) -> None:
        super().__init__(
            f"servo {device.id} answers pings only (status return level 0): write {PINGS_ONLY}=2 alone, by urbihw "
            "servo write, with --id"
        )
        self.device = device


def moving_items(table: ControlTable) -> set[str]:
    """Return the items that move a servo or hold it."""
    effectors = {mode.effector for mode in table.modes}
    return effectors | {name for name in table.items if name.startswith("goal_")} | {TORQUE} & table.items.keys()


def bus_for(link: Link, device: ServoDevice) -> ServoBus:
    """Return a bus that speaks the protocol of a device."""
    bus = ServoBus(link, 2 if device.protocol == 2 else 1)
    bus.protocols[device.id] = device.protocol
    return bus


class ServoRegisters:
    """The registers of one device.

    Attributes:
        bus: for transactions with it.
        device: its description, as it was found.
        table: its control table.
        torque_was_on: whether it had torque before the first write.

    Raises ServoError when nothing is known of its model.
    """

    def __init__(self, link: Link, device: ServoDevice) -> None:
        if device.model == 0:
            raise PingsOnly(device)
        if device.table is None:
            raise ServoError(f"servo {device.id}: {device.name} is not known, so its registers are not")
        self.table: ControlTable = device.table
        self.bus = bus_for(link, device)
        self.device = device
        self.torque_was_on = False
        self._answers = device.answers_writes

    def read(self, names: Iterable[str] | None = None) -> dict[str, int]:
        """Return raw values by name: of these items, or of all whose reading changes nothing, in order of address.

        Without names, items that the servo refuses are left out. Raises BadValue for a name it does not have;
        BusTimeout, BadFrame, DeviceRefused, LinkGone.
        """
        items = self.table.items
        wanted = [name for name in items if not items[name].clears_on_read] if names is None else names
        values: dict[str, int] = {}
        for block in read_blocks(self.table, wanted, self.device.protocol):
            try:
                values.update(self._read_block(block))
            except DeviceRefused:
                # An older firmware may lack one of these registers.
                values.update(self._read_singly(block.names, leave_out=names is None))
        return {name: values[name] for name in self.table.items if name in values}

    def _read_block(self, block: Block) -> dict[str, int]:
        return block.unpack(self.bus.read(self.device.id, block.address, block.size, _RETRIES))

    def _read_singly(self, names: Iterable[str], *, leave_out: bool) -> dict[str, int]:
        """Read items one by one; those that the servo refuses are left out, or raise DeviceRefused."""
        values: dict[str, int] = {}
        for name in names:
            (block,) = read_blocks(self.table, [name], self.device.protocol)
            try:
                values.update(self._read_block(block))
            except DeviceRefused:
                if not leave_out:
                    raise
        return values

    def read_one(self, name: str) -> int:
        """Return the raw value of one item. Raises as `read`."""
        return self.read([name])[name]

    def write(self, name: str, raw: int) -> None:
        """Write an item and check it, with the torque off.

        Raises ServoError for one that would move the servo, that has its own command, or that did not take the value;
        BadValue for an unknown name or a value outside its range; LinkGone.
        """
        item = self.table.item(name)
        self.check_writable(item)
        self.check_value(item, raw)
        if name == TORQUE and raw == 0:
            self.turn_torque_off()
            return
        if name in moving_items(self.table):
            raise ServoError(f"{name} is not written: these tools move nothing")
        self.turn_torque_off()
        with self.unlocked(item):
            self.store(item, raw)

    def check_writable(self, item: Item) -> None:
        """Raise ServoError for an item that cannot be written, or only by a command of its own."""
        if "W" not in item.access:
            raise ServoError(f"{item.name} can only be read")
        if item.name in OWN_COMMANDS:
            raise ServoError(f"{item.name} is not written by name: {OWN_COMMANDS[item.name]}")

    def check_value(self, item: Item, raw: int) -> None:
        """Raise BadValue for a value outside the range, ServoError for one that makes the servo silent.

        Source: e-manual, Status Return Level: at 0 a servo answers pings only, so no write to it could be checked.
        """
        item.check(raw)
        if item.name == PINGS_ONLY and raw == 0:
            raise ServoError(
                f"servo {self.device.id}: {item.name} 0 is not written: it would answer pings only, and no tool could "
                "read it"
            )

    def turn_torque_off(self) -> None:
        """Switch the torque off if it is on. Raises ServoError if it stays on; LinkGone."""
        if TORQUE in self.table.items and self.read_one(TORQUE):
            self.torque_was_on = True
            self.store(self.table.item(TORQUE), 0)

    def store(self, item: Item, raw: int) -> None:
        """Write one item and read it back, without any other care. Raises ServoError, LinkGone."""
        refusal = self.transmit(item, raw)
        if item.name in ANSWER_LEVELS:
            self._answers = raw >= item.high
        try:
            found = self.read_one(item.name)
        except (BusTimeout, BadFrame) as error:
            silent = f"servo {self.device.id} is silent after a write of {item.name}; is it powered?"
            raise ServoError(silent) from error
        if found != raw:
            why = f": it refused ({refusal})" if refusal else ""
            raise ServoError(f"servo {self.device.id}: {item.name} is {found} after writing {raw}{why}")

    def transmit(self, item: Item, raw: int) -> str:
        """Send a write and let it be stored; return the servo's refusal, "" for none. Raises LinkGone.

        A missing answer is no failure: a change of the id or of the answers themselves may swallow it.
        """
        refusal = ""
        try:
            self.bus.write(self.device.id, item.address, item.pack(raw), answered=self._answers, retries=0)
        except DeviceRefused as error:
            refusal = error.meaning
        except (BusTimeout, BadFrame):
            pass
        self.bus.discard_until(self.bus.clock.now() + (STORE_TIME if item.area == "E" else 0.0))
        return refusal

    @contextlib.contextmanager
    def unlocked(self, item: Item) -> Iterator[None]:
        """Unlock the EEPROM for a write of `item`, and lock it again. Raises ServoError, LinkGone."""
        if item.area == "E":
            self._check_lock()
        with eeprom.unlocked(self.table, item, self.store):
            yield

    def unlock(self) -> bool:
        """Unlock the EEPROM; return whether `lock` must be called afterwards. Raises ServoError, LinkGone."""
        self._check_lock()
        return eeprom.open_lock(self.table, self.store)

    def lock(self) -> None:
        """Lock the EEPROM of a model that has a lock. Raises ServoError, LinkGone."""
        eeprom.close_lock(self.table, self.store)

    def _check_lock(self) -> None:
        """Raise ServoError if the EEPROM has a lock that stays closed until the servo loses power (AX), and it is."""
        if LOCK in self.table.items and not self.table.eeprom_lock and self.read_one(LOCK):
            raise ServoError(f"servo {self.device.id}: its EEPROM is locked until it loses power: switch it off and on")


def stored_items(table: ControlTable) -> list[Item]:
    """Return the items that a restore may write: those of the EEPROM, but not id, speed and protocol."""
    fixed = {*OWN_COMMANDS, *moving_items(table), "protocol_type"}
    return [item for item in table.items.values() if item.area == "E" and "W" in item.access and item.name not in fixed]


def differences(table: ControlTable, wanted: Mapping[str, int], found: Mapping[str, int]) -> dict[str, tuple[int, int]]:
    """Return the EEPROM items that differ, in order of address: name -> (present value, wanted value)."""
    names = [item.name for item in stored_items(table) if item.name in wanted and item.name in found]
    return {name: (found[name], wanted[name]) for name in names if found[name] != wanted[name]}


def write_differences(registers: ServoRegisters, changes: Mapping[str, tuple[int, int]]) -> list[str]:
    """Write what `differences` found; return a line for each item that did not take its value.

    A servo refuses, for instance, a lower limit above its upper one; what was refused is tried again after the others.
    Raises ServoError when it falls silent, LinkGone.
    """
    problems: dict[str, str] = {}
    for names in (list(changes), None):
        for name in list(problems) if names is None else names:
            problems.pop(name, None)
            try:
                registers.write(name, changes[name][1])
            except (ServoError, BadValue) as error:
                problems[name] = str(error)
    return list(problems.values())
