"""What all devices on the bus share: slots made from the rows of ``slots``, samples taken in, settings set again.

Physical units outside, raw counts inside.  A sample costs a dict look-up per register that did not change.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import ClassVar

from urbihw.buses.dynamixel import units
from urbihw.buses.dynamixel.device import DeviceInfo
from urbihw.buses.dynamixel.item import Table
from urbihw.buses.dynamixel.tables import table_of
from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import UObject, UVar, event, function, number, reading, set_range
from urbihw.platforms.bioloid.slots import Facts, Kind, Slot, facts_of
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.wire import Wire

Take = Callable[[int, float], None]
"""Takes a changed raw count and its time."""
Refused = Callable[["Device", str, str], None]
"""Told of a write that the device did not take: device, slot, why."""


class Device(UObject):
    """A servo or a sensor.  ``state`` is "ok", "suspect", "lost" or "back"; ``stale`` tells that the values are old."""

    kind_of_device: ClassVar[str] = "device"

    id = reading()
    model = reading()
    modelName = reading()
    firmware = reading()
    state = reading("ok")
    stale = reading(True)
    alarm = reading("")
    lost = event()
    back = event()

    rows: tuple[Slot, ...] = ()
    hidden: tuple[tuple[str, float], ...] = ()
    """Registers that are read but are no slots, and the seconds between readings."""
    log: DeviceLog
    """Set by the robot."""

    def init(self, wire: Wire, info: DeviceInfo, refused: Refused) -> None:
        """Make the slots of the device that ``info`` tells of; it is read from now on."""
        table = table_of(info.model)
        assert table is not None, "the robot makes devices of known models only"
        self.number = info.id
        self.wire = wire
        self.table: Table = table
        self.facts: Facts = facts_of(info.name)
        self.protocol = info.protocol
        self.raw: dict[str, int] = {}
        self._values: Mapping[str, int] = {}
        self._stamp = self.host.now()
        self._read_at: dict[str, float] = {}
        self.seen = self.host.now()
        self.settings: dict[str, int] = {}
        self._tell_refused = refused
        self._takers: dict[str, list[Take]] = {}
        self._missing: set[str] = set()
        for var, value in ((self.id, info.id), (self.model, info.model), (self.firmware, info.firmware)):
            var.sense(float(value))
        self.modelName.sense(info.name)
        for row in self.rows:
            self._bind(row)
        self.on_change("state", self.take_state)
        self.prepare()
        self.start_reading()

    def prepare(self) -> None:
        """What a class adds before the first reading; override."""

    @function
    def age(self) -> float:
        """Seconds since the device last answered."""
        return self.host.now() - self.seen

    # ---------------------------------------------------------------- slots

    def _bind(self, row: Slot) -> None:
        var = self.bind_var(row.name, math.nan, owned=True, writable=row.kind is not Kind.READ)
        item = self.table.item(row.item)
        unit = row.view.unit or units.unit_of(item).symbol
        if unit:
            var.set_property("unit", unit)
        self.on_change(row.item, self.taker(row, var))
        var.dated = lambda: self.read_at(row.item)
        if row.kind in (Kind.READ, Kind.OWN):
            return
        least, most = sorted(self._shown(row, si) for si in units.limits_si(item))
        set_range(var, least, most)
        act = {
            Kind.SETTING: self._set,
            Kind.ALWAYS: self._set_always,
            Kind.COUNTER: self._write_slot,
            Kind.KEPT: self._keep,
        }[row.kind]
        self.notify_change(var, lambda: act(row, self._raw_of(row, var)))

    def taker(self, row: Slot, var: UVar) -> Take:
        """What takes a changed register into the slot of a row; override for rows of kind OWN."""
        convert, show, facts = units.unit_of(self.table.item(row.item)).to_si, row.view.show, self.facts

        def take(raw: int, stamp: float) -> None:
            var.sense(show(convert(raw), facts), stamp)

        return take

    def on_change(self, item: str, take: Take) -> None:
        """Call ``take(raw, stamp)`` whenever a register changed."""
        self._takers.setdefault(item, []).append(take)

    def _shown(self, row: Slot, si: float) -> float:
        return float(row.view.show(si, self.facts))

    def _raw_of(self, row: Slot, var: UVar) -> int:
        return units.from_si(self.table.item(row.item), row.view.take(number(var), self.facts))

    # ---------------------------------------------------------------- writing

    def _set(self, row: Slot, raw: int) -> None:
        self.settings[row.item] = raw
        self.wire.aim(self.number, row.item, raw)

    def _set_always(self, row: Slot, raw: int) -> None:
        self.settings[row.item] = raw
        self._write_slot(row, raw)

    def _keep(self, row: Slot, raw: int) -> None:
        if self.raw.get(row.item) != raw:
            self._write_slot(row, raw)

    def _write_slot(self, row: Slot, raw: int) -> None:
        self.write(row.item, raw, row.name)

    def write(self, item: str, raw: int, slot: str, done: Callable[[bool], None] = lambda ok: None) -> None:
        """Write a register for sure; the slot follows when the device has confirmed it.

        A device that answers with an error may have obeyed all the same (an AX servo whose goal lies outside the
        limits it was just given), or its answer may have got lost; so then it is asked what the register holds.
        """

        def replied(reply: Reply) -> None:
            if reply.ok:
                # A limit may have made something else of it.
                self.take({item: raw if reply.value is None else reply.value}, self.host.now())
                done(True)
            else:
                self.wire.read(self.number, item, lambda second: looked(second, reply.error))

        def looked(reply: Reply, error: str) -> None:
            if reply.ok and reply.value is not None:
                self.take({item: reply.value}, self.host.now())
            obeyed = reply.ok and reply.value == raw
            if not obeyed:
                self.refused(slot, self.explained(error))
            done(obeyed)

        self.wire.write(self.number, item, raw, replied)

    def refused(self, slot: str, reason: str) -> None:
        """Something that urbiscript wanted could not be done."""
        self._tell_refused(self, slot, reason)

    def explained(self, error: str) -> str:
        """What a refusal means for a user; override where there is more to say."""
        return error

    # ---------------------------------------------------------------- reading

    def start_reading(self) -> None:
        """Read everything once, soon; then each register at its own pace."""
        self._missing = {row.item for row in self.rows} | {item for item, _ in self.hidden}
        self._forget_last()
        self.wire.watch(self.number, self._missing, 0.0)

    def take(self, values: Mapping[str, int], stamp: float) -> None:
        """Take what one tick read.  What a robot at rest says a hundred times a second costs next to nothing."""
        self.seen = stamp
        if values == self._values:
            self._stamp = stamp
            return
        if values.keys() != self._values.keys():
            self._forget_last()
        self._values, self._stamp = values, stamp
        known, takers = self.raw, self._takers
        for item, raw in values.items():
            if known.get(item) != raw:
                known[item] = raw
                for take in takers.get(item, ()):
                    take(raw, stamp)
        if self._missing:
            self._missing.difference_update(values)
            if not self._missing:
                self._all_read()

    def expect(self, item: str) -> None:
        """Count the next reading of a register as a change, whatever it is."""
        self.raw.pop(item, None)
        self._forget_last()

    def _forget_last(self) -> None:
        self._read_at.update(dict.fromkeys(self._values, self._stamp))
        self._values = {}

    def read_at(self, item: str) -> float:
        """When a register was last read, in seconds of the kernel's clock."""
        return self._stamp if item in self._values else self._read_at.get(item, -math.inf)

    @property
    def whole(self) -> bool:
        """Whether all registers were read."""
        return not self._missing

    def _all_read(self) -> None:
        paces: dict[float, set[str]] = {}
        for row in self.rows:
            paces.setdefault(row.pace, set()).add(row.item)
        for item, pace in self.hidden:
            paces.setdefault(pace, set()).add(item)
        for pace, items in sorted(paces.items()):
            if pace:
                self.wire.watch(self.number, sorted(items), pace)
        self.stale.sense(False)

    def take_state(self, raw: int, stamp: float) -> None:
        """The lasting error bits of its answers changed; override where a register says more."""

    # ---------------------------------------------------------------- being there or not

    def changed_state(self, new: str, reason: str) -> None:
        """The worker says that the device is ok, suspect, lost or back."""
        self.state.sense(new)
        if new == "lost":
            self.stale.sense(True)
            self.lost.emit(reason)
        elif new == "back":
            self.restore()
            self.back.emit()

    def link_changed(self, up: bool) -> None:
        """The bus went down, or is up again with this device on it."""
        if up:
            self.restore()
        else:
            self.stale.sense(True)

    def restore(self) -> None:
        """Set again what urbiscript had set, for the device may have been without power; nothing that moves it."""
        for item, raw in self.lasting().items():
            self.wire.aim(self.number, item, raw)
        self.start_reading()

    def lasting(self) -> dict[str, int]:
        """What urbiscript had set and may be set again."""
        return self.settings

    def show_alarm(self, words: str) -> None:
        """Say what is wrong with the device; "" for nothing."""
        if words and words != self.alarm.sensed:
            self.log.warning("%s %d: %s", self.kind_of_device, self.number, words)
        self.alarm.sense(words)
