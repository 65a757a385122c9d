"""Object: the properties of slots, ``slot->name``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.slot import meta_of, peek_meta
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.accessors import set_getter, set_setter
from urbihw.kernel.stdlib.support import slot_holder
from urbihw.kernel.value import Value

TABLE = Table("Object")


@TABLE.primitive("getProperty")
def get_property(world: World, this: Value, slot: str, name: str) -> Value:
    """A property of a slot, void if it is not set.  Raises ``lookup failed`` for the slot.

    ``constant`` tells whether the slot is constant, ``changed`` is the event emitted at every write, ``timestamp`` of a
    device's variable is the time at which its value was measured.
    """
    holder = slot_holder(world, this, slot)
    if name == "timestamp":
        stamp = getattr(meta_of(holder, slot).accessor, "stamp", None)
        if stamp is not None:
            return stamp
    if name == "changed":
        meta = meta_of(holder, slot)
        if meta.changed is None:
            meta.changed = Event(world, [world.event_proto])
        return meta.changed
    found = _all(world, holder, slot).get(name)
    if found is None and name == "unit":
        return described_property(world, this, slot, name)
    return world.void if found is None else found


@TABLE.primitive("setProperty")
def set_property(world: World, this: Value, slot: str, name: str, value: Value) -> Value:
    """Set a property of a slot.  Raises ``lookup failed`` for the slot.

    ``oget`` and ``oset`` are functions that are called when the slot is read or assigned; the slot need not exist.
    """
    if name == "oget":
        set_getter(world, this, slot, value)
        return value
    if name == "oset":
        set_setter(world, this, slot, value)
        return value
    holder = slot_holder(world, this, slot)
    meta = meta_of(holder, slot)
    if name == "constant":
        if slot in world.record.protected:
            world.record.guard_removal(holder, slot)
        meta.constant = bool(value)
    elif name == "changed":
        if not isinstance(value, Event):
            raise world.type_error(3, value, "Event")
        meta.changed = value
    else:
        if meta.properties is None:
            meta.properties = {}
        meta.properties[name] = value
    return value


@TABLE.primitive("hasProperty")
def has_property(world: World, this: Value, slot: str, name: str) -> bool:
    """Whether a slot has a property.  Raises ``lookup failed`` for the slot."""
    return name in _all(world, slot_holder(world, this, slot), slot)


@TABLE.primitive("removeProperty")
def remove_property(world: World, this: Value, slot: str, name: str) -> None:
    """Remove a property of a slot, if it is set.  Raises ``lookup failed`` for the slot."""
    meta = peek_meta(slot_holder(world, this, slot), slot)
    if meta is not None and meta.properties is not None:
        meta.properties.pop(name, None)


@TABLE.primitive("properties")
def properties(world: World, this: Value, slot: str) -> Value:
    """All properties of a slot, as a Dictionary.  Raises ``lookup failed`` for the slot."""
    return world.dictionary(_all(world, slot_holder(world, this, slot), slot))


def find_property(this: Obj, name: str, wanted: str) -> Value:
    """A property of a slot, or of the slot of that name in the first prototype that has the property; else None."""
    return next((found for one in _family(this) if (found := _stored(one, name, wanted)) is not None), None)


def describers_of(this: Obj) -> list[Obj]:
    """The prototypes of an object that describe the slots of their heirs, the nearest first."""
    return [one for one in _family(this) if one.describes_heirs]


def described_property(world: World, this: Value, slot: str, name: str) -> Value:
    """The property that the prototypes of an object declare for a slot of their heirs; void if they do not."""
    for one in describers_of(world.peek_obj(this)):
        found = _stored(one, slot, name)
        if found is not None:
            return found
    return world.void


def _stored(holder: Obj, slot: str, name: str) -> Value:
    """A property as it is stored with an object; None for none."""
    meta = peek_meta(holder, slot)
    return None if meta is None or not meta.properties else meta.properties.get(name)


def _family(this: Obj) -> Iterator[Obj]:
    """An object and its prototypes, each once and before its own prototypes."""
    seen: set[int] = set()
    waiting = [this]
    while waiting:
        one = waiting.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        yield one
        waiting += [proto for proto in reversed(one.protos) if isinstance(proto, Obj)]


def own_properties(world: World, holder: Value, slot: str) -> dict[str, Any]:
    """The properties that were set explicitly, without ``constant``."""
    meta = peek_meta(holder, slot)
    return dict(meta.properties) if meta is not None and meta.properties is not None else {}


def _all(world: World, holder: Value, slot: str) -> dict[str, Any]:
    meta = peek_meta(holder, slot)
    return own_properties(world, holder, slot) | {"constant": world.boolean(meta is not None and meta.constant)}
