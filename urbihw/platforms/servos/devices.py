"""The base of all devices on the bus: slots from the rows of ``slots``, updates from samples, restored settings.

Slots are in physical units, registers in raw counts.  A sample costs one dict look-up per unchanged register.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import ClassVar, Final

from urbihw.buses.messages import Reply
from urbihw.buses.servos import units
from urbihw.buses.servos.device import DeviceInfo
from urbihw.buses.servos.item import ControlTable
from urbihw.buses.servos.tables import table_for
from urbihw.frozen import frozen
from urbihw.kernel.uobject import Motion, UObject, UVar, event, function, number, reading, set_range
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.servos import words
from urbihw.platforms.servos.registers import RawRegisters
from urbihw.platforms.servos.slots import ChangeHandler, Facts, Kind, RegisterSlot, facts_of, rows_of

Refused = Callable[["ServoBusDevice", str, str], None]
"""Called for a write that the device refused: device, slot, reason."""
WRITE_LATENCY_S: Final = 0.25
"""Seconds after an unconfirmed write in which a reading with another value is taken for an older one."""


@frozen(eq=False)
class PendingWrite:
    """A write whose result is not known yet: its value, the value before it, and when a reading must show it."""

    raw: int
    before: int | None
    until: float


class ServoBusDevice(UObject):
    """A servo or a sensor.  ``state`` is "ok", "suspect", "lost" or "back"; ``stale``: the values are old."""

    slot_words = words.DEVICE

    parts = (RawRegisters,)

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

    table: ControlTable
    rows: tuple[RegisterSlot, ...] = ()
    """Its slots; () for those that its control table has of all slots of servos."""
    hidden: tuple[tuple[str, float], ...] = ()
    """Registers that are read but are no slots, and the seconds between readings."""
    log: DeviceLog
    motion: Motion
    """Both are set by the robot."""
    state_changed: Callable[[], None] = staticmethod(lambda: None)
    """Called when ``state`` has changed; set by the robot."""
    _told = "ok", ""
    _contact = "ok"
    """What the worker tells of its answers: ok, suspect, lost or back."""

    def init(self, channel: DeviceChannel, info: DeviceInfo, refused: Refused) -> None:
        """Make the slots of the device that ``info`` describes, and start reading it."""
        self.number = info.id
        self.channel = channel
        self.table = self.table_for(info)
        if not self.rows:
            self.rows = rows_of(self.table)
        self.facts: Facts = facts_of(info.name)
        self.protocol = info.protocol
        self.raw: dict[str, int] = {}
        self._wanted: dict[str, PendingWrite] = {}
        self._values: Mapping[str, int] = {}
        self._stamp = self.host.now()
        self._read_at: dict[str, float] = {}
        self.seen = self.host.now()
        self.settings: dict[str, int] = {}
        self._report_refused = refused
        RawRegisters(self, self)
        self._handlers: dict[str, list[ChangeHandler]] = {}
        self._missing: set[str] = set()
        for var, value in ((self.id, info.id), (self.model, info.model), (self.firmware, info.firmware)):
            var.sense(float(value))
        self.modelName.sense(info.name)
        for row in self.rows:
            self._bind_slot(row)
        self.on_change("state", self.on_state_bits)
        self.prepare()
        self.start_reading()

    @staticmethod
    def table_for(info: DeviceInfo) -> ControlTable:
        """Return the control table of a device; of an unknown model, what all models of its protocol share."""
        return table_for(info.model, info.protocol)

    def prepare(self) -> None:
        """Bind additional slots before the first reading; override."""

    @function
    def age(self) -> float:
        """Seconds since the device last answered."""
        return max(0.0, self.host.now() - self.seen)

    # ---------------------------------------------------------------- slots

    def _bind_slot(self, row: RegisterSlot) -> None:
        var = self.bind_var(row.name, math.nan, owned=True, writable=row.kind is not Kind.READ)
        item = self.table.item(row.item)
        fraction = row.view.unit and not self.facts.is_known
        unit = "1" if fraction else row.view.unit or self.describe_slot(row.name)[1] or units.unit_of(item).symbol
        if unit:
            var.set_property("unit", unit)
        self.on_change(row.item, self.change_handler(row, var))
        var.dated = lambda: self.read_at(row.item)
        if row.kind in (Kind.READ, Kind.OWN):
            return
        least, most = sorted(self._shown(row, si) for si in units.limits_si(item))
        set_range(var, least, most)
        act = {
            Kind.SETTING: self.write_setting,
            Kind.ALWAYS: self._write_setting_confirmed,
            Kind.COUNTER: self._write_slot,
            Kind.KEPT: self._write_if_changed,
        }[row.kind]
        self.notify_change(var, lambda: act(row, self.raw_of(row, number(var))))

    def change_handler(self, row: RegisterSlot, var: UVar) -> ChangeHandler:
        """Return the handler that shows a changed register in the slot of a row; override for rows of kind OWN."""
        convert, show, facts = units.unit_of(self.table.item(row.item)).to_si, row.view.show, self.facts

        def show_value(raw: int, stamp: float) -> None:
            var.sense(show(convert(raw), facts), stamp)

        return show_value

    def on_change(self, item: str, handler: ChangeHandler) -> None:
        """Call ``handler(raw, stamp)`` whenever a register changed."""
        self._handlers.setdefault(item, []).append(handler)

    def _shown(self, row: RegisterSlot, si: float) -> float:
        return float(row.view.show(si, self.facts))

    def raw_of(self, row: RegisterSlot, value: float) -> int:
        """Return the raw count for a value of a slot.  Raises BadValue."""
        return units.from_si(self.table.item(row.item), row.view.to_si(value, self.facts))

    # ---------------------------------------------------------------- writing

    def write_setting(self, row: RegisterSlot, raw: int) -> None:
        """Write a setting with the next tick; override to refuse."""
        self.set_setting(row.item, raw)
        self.show_wanted(row.item, raw)

    def set_setting(self, item: str, raw: int) -> None:
        """Send a setting with the next tick, and keep it for a device that forgets it; nothing that moves the device.

        Override for registers that move it in another mode: their writes carry an origin.
        """
        self.settings[item] = raw
        self.channel.set_target(self.number, item, raw)

    def restore_refused(self) -> None:
        """Send the settings once more that the worker may have refused because an emergency stop held."""

    def _write_setting_confirmed(self, row: RegisterSlot, raw: int) -> None:
        self.settings[row.item] = raw
        self._write_slot(row, raw)

    def _write_if_changed(self, row: RegisterSlot, raw: int) -> None:
        if self.raw.get(row.item) != raw:
            self._write_slot(row, raw)

    def _write_slot(self, row: RegisterSlot, raw: int) -> None:
        self.write(row.item, raw, row.name)

    def write(self, item: str, raw: int, slot: str, done: Callable[[bool], None] = lambda ok: None) -> None:
        """Write a register by a request; the slot is updated when the device has acknowledged it.

        A device that answers with an error may have executed the write all the same (an AX servo whose goal lies
        outside the limits it was just given), or its answer may have got lost; so the register is then read back.
        """

        wanted = self.show_wanted(item, raw)

        def replied(reply: Reply) -> None:
            if reply.ok:
                # A limit may have changed the value.
                self._end_write(item, wanted, raw if reply.value is None else reply.value)
                done(True)
            else:
                self.channel.read(self.number, item, lambda second: looked(second, reply.error))

        def looked(reply: Reply, error: str) -> None:
            self._end_write(item, wanted, reply.value if reply.ok else None)
            obeyed = reply.ok and reply.value == raw
            if not obeyed:
                self.refused(slot, self.explain_error(error))
            done(obeyed)

        self.channel.write(self.number, item, raw, replied)

    def show_wanted(self, item: str, raw: int) -> PendingWrite:
        """Show the value of a write at once, and until its result is known, or until a reading must have it."""
        old = self._wanted.get(item)
        before = self.raw.get(item) if old is None else old.before
        made = self._wanted[item] = PendingWrite(raw, before, self.host.now() + WRITE_LATENCY_S)
        self._show(item, raw, self.host.now())
        return made

    def _end_write(self, item: str, wanted: PendingWrite, raw: int | None) -> None:
        """Show the value that the device has told, None if it has not answered; a later write is shown instead."""
        if self._wanted.get(item) is not wanted:
            return
        del self._wanted[item]
        if raw is not None:
            self.update_values({item: raw}, self.host.now())
        elif wanted.before is not None:
            self._show(item, wanted.before, self._stamp)

    def _show(self, item: str, raw: int, stamp: float) -> None:
        if self.raw.get(item) != raw:
            self.raw[item] = raw
            for handler in self._handlers.get(item, ()):
                handler(raw, stamp)

    def _without_outdated(self, values: Mapping[str, int], stamp: float) -> Mapping[str, int]:
        """Return a sample without the readings that may be older than the last write of their register."""
        outdated = set()
        for item, wanted in list(self._wanted.items()):
            raw = values.get(item)
            if raw is None:
                continue
            if raw != wanted.raw and stamp < wanted.until:
                outdated.add(item)
            else:
                del self._wanted[item]
        return {item: raw for item, raw in values.items() if item not in outdated}

    def refused(self, slot: str, reason: str) -> None:
        """Report a write of urbiscript that was not executed."""
        self._report_refused(self, slot, reason)

    def explain_error(self, error: str) -> str:
        """Return a refusal in words for the user; override to add advice."""
        return error

    # ---------------------------------------------------------------- reading

    def start_reading(self) -> None:
        """Read all registers once with the next ticks, then each at its own period."""
        self._missing = {row.item for row in self.rows} | {item for item, _ in self.hidden}
        self._clear_last_sample()
        self.channel.watch(self.number, self._missing, 0.0)

    def update_values(self, values: Mapping[str, int], stamp: float) -> None:
        """Update from the values of one tick.  The unchanged samples of a robot at rest cost one comparison."""
        self.seen = stamp
        if values == self._values and not self._wanted:
            self._stamp = stamp
            return
        if values.keys() != self._values.keys():
            self._clear_last_sample()
        self._values, self._stamp = values, stamp
        known, handlers = self.raw, self._handlers
        for item, raw in (self._without_outdated(values, stamp) if self._wanted else values).items():
            if known.get(item) != raw:
                known[item] = raw
                for handler in handlers.get(item, ()):
                    handler(raw, stamp)
        if self._missing:
            self._missing.difference_update(values)
            if not self._missing:
                self.on_all_read()

    def mark_unread(self, item: str) -> None:
        """Treat the next reading of a register as a change, whatever its value."""
        self.raw.pop(item, None)
        self._clear_last_sample()

    def _clear_last_sample(self) -> None:
        self._read_at.update(dict.fromkeys(self._values, self._stamp))
        self._values = {}

    def read_at(self, item: str) -> float:
        """Return when a register was last read, in seconds of the kernel's clock."""
        return self._stamp if item in self._values else self._read_at.get(item, -math.inf)

    @property
    def is_complete(self) -> bool:
        """Whether all registers were read."""
        return not self._missing

    def on_all_read(self) -> None:
        """All registers have been read: read each at its own period from now on; override to do more."""
        paces: dict[float, set[str]] = {}
        for row in self.rows:
            paces.setdefault(row.pace, set()).add(row.item)
        for item, pace in self.hidden:
            paces.setdefault(pace, set()).add(item)
        for pace, items in sorted(paces.items()):
            if pace:
                self.channel.watch(self.number, sorted(items), pace)
        self.stale.sense(False)

    def on_state_bits(self, raw: int, stamp: float) -> None:
        """The lasting error bits of its answers changed; override to show them."""

    # ---------------------------------------------------------------- loss and return

    def changed_state(self, new: str, reason: str) -> None:
        """The worker reports the device as ok, suspect, lost or back."""
        self._contact = new
        self.update_state()
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
        """Write the settings of urbiscript again, since the device may have lost power; nothing that moves it."""
        for item, raw in self.restorable_settings().items():
            self.set_setting(item, raw)
        self.start_reading()

    def restorable_settings(self) -> dict[str, int]:
        """Return the settings of urbiscript that ``restore`` may write again: register -> raw count."""
        return self.settings

    def show_alarm(self, words: str) -> None:
        """Show and log an alarm of the device; "" for none."""
        if words and words != self.alarm.sensed:
            self.log.warning("%s %d: %s", self.kind_of_device, self.number, words)
        self.alarm.sense(words)
        self.update_state()

    def explain_alarm(self) -> str:
        """Return why an alarm keeps it from doing what it is told, and what helps; "" if none does; override."""
        return ""

    def update_state(self) -> None:
        """Show in ``state`` whether the device answers, and whether an alarm keeps it from doing what it is told."""
        alarm = self.explain_alarm() if self._contact in ("ok", "back") else ""
        told = "alarm" if alarm else self._contact, alarm
        if told != self._told:
            self._told = told
            self.state.sense(told[0])
            self.state_changed()
