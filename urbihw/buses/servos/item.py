"""One register of a control table, and the table itself."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from urbihw.buses.errors import BadValue


class Motion(Enum):
    """What writing an item does to the shaft."""

    POSITION = "position"  # moves to a position; to hold still, the target is the present position
    RATE = "rate"  # a speed, a current or a PWM; 0 means stop


@dataclass(frozen=True, slots=True)
class Item:
    """A register, or two or four that belong together, low byte first.

    Attributes:
        name: lower case with underscores, for instance "goal_position".
        address: of the low byte.
        size: 1, 2 or 4 bytes.
        access: "R" or "RW".
        area: "E" EEPROM (kept without power, write rarely), "R" RAM (reset at power-on).
        low, high: range of values that may be written, or that are read.
        default: factory or power-on value, None if the manual names none.
        unit: row of `units.UNITS`.
        wheel_unit: the row used in wheel mode instead, "" if it is the same.
        clears_on_read: reading it changes the device, so it must not be read along with its neighbours.
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

    @property
    def signed(self) -> bool:
        """True for two's complement."""
        return self.low < 0

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
        return raw.to_bytes(self.size, "little", signed=self.signed)

    def unpack(self, data: bytes) -> int:
        """Return the value of `size` received bytes."""
        return int.from_bytes(data, "little", signed=self.signed)


@dataclass(frozen=True)
class Mode:
    """How the safe stop treats a servo in one operating mode.

    Attributes:
        name: as a text.
        effector: item that moves the shaft in this mode.
        motion: whether that item is a position or a rate.
        limits: the items with the lowest and the highest position, () for none.
    """

    name: str
    effector: str
    motion: Motion
    limits: tuple[str, ...] = ()


@dataclass(frozen=True)
class Table:
    """The control table of a family of devices.

    Attributes:
        name: of the family.
        protocol: 1 or 2, as shipped.
        models: model number -> name of the model.
        items: name -> Item, in order of address.
        modes: value of the mode register (see `mode_of`) -> Mode; empty for a device without a shaft.
        fast_firmware: firmware from which FAST SYNC READ works, None for never.
        mode_items: the items that decide the mode.
    """

    name: str
    protocol: int
    models: Mapping[int, str]
    items: Mapping[str, Item]
    modes: Mapping[int, Mode] = field(default_factory=dict)
    fast_firmware: int | None = None
    mode_items: tuple[str, ...] = ()

    def item(self, name: str) -> Item:
        """Return an item by name. Raises BadValue naming the table."""
        try:
            return self.items[name]
        except KeyError:
            raise BadValue(f"{self.name} has no item {name!r}") from None

    def mode_of(self, values: Mapping[str, int]) -> Mode | None:
        """Return the mode for the values of `mode_items`; None for a sensor or an unknown mode.

        On the AX series both angle limits 0 mean wheel mode; on the X series a register names the mode.
        """
        if not self.mode_items:
            return None
        key = values[self.mode_items[0]] if len(self.mode_items) == 1 else int(any(values[n] for n in self.mode_items))
        return self.modes.get(key)

    @property
    def setup_items(self) -> tuple[str, ...]:
        """The items that the worker reads once from each device: mode, position limits, status level, bus watchdog."""
        limits = {name for mode in self.modes.values() for name in mode.limits}
        wanted = {*self.mode_items, *limits, "status_return_level", "bus_watchdog"}
        return tuple(name for name in self.items if name in wanted)

    @property
    def has_motor(self) -> bool:
        """False for a sensor."""
        return bool(self.modes)


def by_name(items: Iterable[Item]) -> dict[str, Item]:
    """Return items by name, in order of address. Raises BadValue for a duplicate name."""
    found: dict[str, Item] = {}
    for item in sorted(items, key=lambda item: item.address):
        if item.name in found:
            raise BadValue(f"item {item.name} appears twice in a table")
        found[item.name] = item
    return found
