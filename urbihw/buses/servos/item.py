"""One register of a control table, and the table itself."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import field
from enum import Enum
from functools import cached_property
from typing import Final

from urbihw.buses.errors import BadValue
from urbihw.frozen import frozen

_PLACE: Final = re.compile(r"@(\d+):(\d+)")
_SIZES: Final = (1, 2, 4)


class ShaftMotion(Enum):
    """What writing an item does to the shaft."""

    POSITION = "position"  # moves to a position; to hold still, the target is the present position
    RATE = "rate"  # a speed, a current or a PWM; 0 means stop


@frozen
class Item:
    """A register, or two or four that belong together.

    Attributes:
        name: lower case with underscores, for instance "goal_position".
        address: of the first byte.
        size: 1, 2 or 4 bytes.
        access: "R" or "RW".
        area: "E" EEPROM (kept without power, write rarely), "R" RAM (reset at power-on).
        low, high: range of values that may be written, or that are read.
        default: factory or power-on value, None if the manual names none.
        unit: row of `units.UNITS`.
        wheel_unit: the row used in wheel mode instead, "" if it is the same.
        clears_on_read: reading it changes the device, so it must not be read along with its neighbours.
        sign_bit: the bit that means "negative" for sign and magnitude; None for two's complement and unsigned values.
        big_endian: the high byte comes first.
    """

    name: str
    address: int
    size: int
    access: str
    area: str
    low: int
    high: int
    default: int | None
    unit: str = "count"
    wheel_unit: str = ""
    clears_on_read: bool = False
    sign_bit: int | None = None
    big_endian: bool = False

    @property
    def signed(self) -> bool:
        """True for two's complement."""
        return self.low < 0 and self.sign_bit is None

    @property
    def end(self) -> int:
        """Address behind the last byte."""
        return self.address + self.size

    def check(self, raw: int) -> None:
        """Raise BadValue if `raw` lies outside low..high."""
        if not self.low <= raw <= self.high:
            raise BadValue(f"{self.name} takes {self.low}..{self.high}, not {raw}")

    def pack(self, raw: int) -> bytes:
        """Return the bytes of `raw`. Raises BadValue outside low..high."""
        self.check(raw)
        if self.sign_bit is not None:
            raw = magnitude_of(raw, self.sign_bit)
        return raw.to_bytes(self.size, "big" if self.big_endian else "little", signed=self.signed)

    def unpack(self, data: bytes) -> int:
        """Return the value of `size` received bytes."""
        raw = int.from_bytes(data, "big" if self.big_endian else "little", signed=self.signed)
        return raw if self.sign_bit is None else number_of(raw, self.sign_bit)


def magnitude_of(number: int, sign_bit: int) -> int:
    """Return a number as sign and magnitude, the sign in bit `sign_bit`."""
    return -number | 1 << sign_bit if number < 0 else number


def number_of(magnitude: int, sign_bit: int) -> int:
    """Return the number of a sign and a magnitude: the inverse of `magnitude_of`."""
    size = magnitude & ((1 << sign_bit) - 1)
    return -size if magnitude >> sign_bit & 1 else size


@frozen(slots=False)
class Mode:
    """How the safe stop treats a servo in one operating mode.

    Attributes:
        name: as a text.
        effector: item that moves the shaft in this mode.
        motion: whether that item is a position or a rate.
        limits: the items with the lowest and the highest position, () for none.
        when: (item, raw value) pairs of the device that is in this mode.
        direction_bit: the bit of the effector that turns the shaft the other way, None if its sign does.
    """

    name: str
    effector: str
    motion: ShaftMotion
    limits: tuple[str, ...] = ()
    when: tuple[tuple[str, int], ...] = ()
    direction_bit: int | None = None


@frozen(slots=False)
class ControlTable:
    """The control table of a family of devices.

    Attributes:
        name: of the family.
        protocol: 1, 2 or `status.FEETECH`, as shipped.
        models: model number -> name of the model.
        items: name -> Item, in order of address.
        modes: in the order of `mode_of`; empty for a device without a shaft.
        fast_firmware: firmware from which FAST SYNC READ works, None for never.
        big_endian: items of more than one byte have their high byte first.
        eeprom_lock: the item that must be 0 for a write of the EEPROM to be kept, "" for none.
        sync_read: devices of this table answer SYNC READ.
        hardware_errors: bit of the item "hardware_error" -> what it means.
        follows: how a joint follows its goal: seconds by which it is late, and the error in rad with which it pushes as
            hard as it can; see `following`.
        indirect: areas whose bytes stand for other registers: the first address entry (2 bytes each), the first byte of
            data, the number of both.
    """

    name: str
    protocol: int
    models: Mapping[int, str]
    items: Mapping[str, Item]
    modes: tuple[Mode, ...] = ()
    fast_firmware: int | None = None
    big_endian: bool = False
    eeprom_lock: str = ""
    sync_read: bool = False
    hardware_errors: Mapping[int, str] = field(default_factory=dict)
    follows: tuple[float, float] = (0.03, 0.17)
    indirect: tuple[tuple[int, int, int], ...] = ()

    def error_words(self, raw: int) -> str:
        """Return the causes of a hardware error, such as "overheating, overload"; "" for none."""
        return ", ".join(words for bit, words in self.hardware_errors.items() if raw >> bit & 1)

    def item(self, name: str) -> Item:
        """Return an item by name, or by place: "@30:2" is 2 bytes from address 30. Raises BadValue naming the table.

        Places are for registers that the table does not have; one that it has is read and written by its name, so that
        its range, and what it does to the robot, is known.
        """
        try:
            return self.items[name]
        except KeyError:
            if is_place(name):
                return self._item_at(name)
            raise BadValue(f"{self.name} has no item {name!r}") from None

    def _item_at(self, name: str) -> Item:
        place = _PLACE.fullmatch(name)
        address, size = (int(part) for part in place.groups()) if place else (0, 0)
        if size not in _SIZES or address + size > (0x10000 if self.protocol == 2 else 0x100):
            raise BadValue(f'{name!r} is no register: write "@30:2" for 2 bytes (1, 2 or 4) from address 30')
        for item in self.items.values():
            if item.address < address + size and address < item.end:
                raise BadValue(f"{name} of {self.name} is {item.name}: use that name")
        return Item(name, address, size, "RW", "R", 0, (1 << 8 * size) - 1, None, big_endian=self.big_endian)

    def item_around(self, address: int) -> Item | None:
        """Return the item that a byte belongs to, None for a byte without a name."""
        return next((item for item in self.items.values() if item.address <= address < item.end), None)

    @cached_property
    def mode_items(self) -> tuple[str, ...]:
        """The items that decide the mode: an operating mode, or the angle limits of the older models."""
        return tuple(dict.fromkeys(name for mode in self.modes for name, _ in mode.when))

    def mode_of(self, values: Mapping[str, int]) -> Mode | None:
        """Return the first mode whose `when` agrees with the values of `mode_items`; None for an unknown one."""
        for mode in self.modes:
            if all(values[name] == raw for name, raw in mode.when):
                return mode
        return None

    def mode_named(self, name: str) -> Mode:
        """Return a mode by name. Raises BadValue with the modes there are."""
        for mode in self.modes:
            if mode.name == name:
                return mode
        raise BadValue(f"{self.name} has no mode {name!r}: it has {', '.join(mode.name for mode in self.modes)}")

    @cached_property
    def setup_items(self) -> tuple[str, ...]:
        """The items that the worker reads once from each device: mode, position limits, status level, bus watchdog."""
        limits = {name for mode in self.modes for name in mode.limits}
        wanted = {*self.mode_items, *limits, "status_return_level", "response_level", "bus_watchdog"}
        return tuple(name for name in self.items if name in wanted)

    @property
    def has_motor(self) -> bool:
        """False for a sensor."""
        return bool(self.modes)


def is_place(name: str) -> bool:
    """Return whether the name of an item is a place, "@30:2": see `ControlTable.item`."""
    return name.startswith("@")


def by_name(items: Iterable[Item]) -> dict[str, Item]:
    """Return items by name, in order of address. Raises BadValue for a duplicate name."""
    found: dict[str, Item] = {}
    for item in sorted(items, key=lambda item: item.address):
        if item.name in found:
            raise BadValue(f"item {item.name} appears twice in a table")
        found[item.name] = item
    return found
