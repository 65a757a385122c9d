"""System.slotTable: the slots of a device with their present values, for ``help``.  Not in the manual.

No function of the device is called, but those that its class declares to have a unit: they only tell a number.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from urbihw.kernel.library import (
    BinaryObject,
    Event,
    Executable,
    Obj,
    Primitive,
    String,
    Table,
    Value,
    World,
    described_property,
    docstrings_of,
    errors,
    peek_meta,
    prototype,
)
from urbihw.robot.interface import KindObject, Promise, provider

TABLE = Table("System")

MAX_LENGTH: Final = 40
"""Maximum number of characters of a value."""
_HIDDEN: Final = frozenset({"init", "type", "clone", "protos"})


class SlotRow(NamedTuple):
    """One slot; all texts."""

    name: str
    value: str
    unit: str = ""
    range: str = ""
    meaning: str = ""


@TABLE.primitive("slotTable")
def slot_table(world: World, this: Value, device: Any) -> Value:
    """The slots of a device, in alphabetical order: a List of [name, present value, unit, range, meaning] for each,
    all Strings; the value of a function and of an event is empty."""
    rows = rows_of(world, world.peek_obj(device))
    return world.new_list([world.new_list([world.string(word) for word in row]) for row in rows])


def rows_of(world: World, this: Obj) -> list[SlotRow]:
    """The slots that a device does not share with every object, in alphabetical order."""
    said = docstrings_of(world)
    return [
        SlotRow(
            name, _shown(world, _present(world, this, name)), said.unit(this, name), said.range(this, name),
            said.meaning(this, name),
        )
        for name in sorted({*names_of(world, this)})
    ]  # fmt: skip


def names_of(world: World, this: Obj) -> Iterator[str]:
    """The names of the slots that a device does not share with every object; some may come twice."""
    seen = {id(one) for one in (world.object, world.global_, world.uobject_proto)}
    seen |= {id(prototype(world, name)) for name in ("Interface", "Component", "Localizer")}
    waiting = [this]
    while waiting:
        one = waiting.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        for name in one.slots:
            marker = name == "as" + (one.name if isinstance(one, KindObject) else _type_of(one))
            if name.isidentifier() and not name.startswith("_") and name not in _HIDDEN and not marker:
                yield name
        waiting += [proto for proto in one.protos if isinstance(proto, Obj)]


def _type_of(one: Obj) -> str:
    """The name of a class; its instances have it in a slot ``asName``."""
    own = one.slots.get("type")
    return own.s if isinstance(own, String) else ""


def _present(world: World, this: Obj, name: str) -> Value:
    """The value of a slot; None for what only a call would tell."""
    holder = this.find(name)
    if holder is None:
        return None
    slot = holder.slots[name]
    return _promised(world, this, slot) if isinstance(slot, Promise) else _held(this, holder, name)


def _promised(world: World, this: Obj, promise: Promise) -> Value:
    holder, name = provider(world, this, promise.name), promise.name
    if holder is None and promise.other:
        holder, name = provider(world, this, promise.other), promise.other
    if holder is not None:
        return _held(this, holder, name)
    if promise.getter is None:
        return promise.default
    unit = described_property(world, this, promise.name, "unit")
    if unit is world.void or not world.text(unit):
        # The rule of a function, such as stop, must not be called.
        return None
    try:
        return promise.read(this)
    except errors.ThrownError:
        return None


def _held(this: Obj, holder: Obj, name: str) -> Value:
    slot, meta = holder.slots[name], peek_meta(holder, name)
    if meta is not None and meta.accessor is not None:
        return meta.accessor.read(this)
    if isinstance(slot, Primitive) and meta is not None and meta.properties and "unit" in meta.properties:
        return slot.call(this, ())
    return None if isinstance(slot, Executable | Event) else slot


def _shown(world: World, value: Value) -> str:
    if value is None or value is world.void:
        return ""
    if isinstance(value, BinaryObject):
        return f"{len(value.content)} bytes"
    text = world.printable(value)
    return text if len(text) <= MAX_LENGTH else text[: MAX_LENGTH - 3] + "..."
