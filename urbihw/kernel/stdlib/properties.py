"""Object: the properties of slots, ``slot->name``."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.slot import meta_of, peek_meta
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.accessors import set_getter, set_setter
from urbihw.kernel.stdlib.interface import promised_unit
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
        # Its kinds declare it for each device.
        return promised_unit(world, this, slot)
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


def own_properties(world: World, holder: Value, slot: str) -> dict[str, Any]:
    """The properties that were set explicitly, without ``constant``."""
    meta = peek_meta(holder, slot)
    return dict(meta.properties) if meta is not None and meta.properties is not None else {}


def _all(world: World, holder: Value, slot: str) -> dict[str, Any]:
    meta = peek_meta(holder, slot)
    return own_properties(world, holder, slot) | {"constant": world.boolean(meta is not None and meta.constant)}
