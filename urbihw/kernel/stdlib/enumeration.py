"""Enumeration: a type with a few named values.  Source: manual of Urbi 2.7, specs/enumeration; later than 2.3."""

from __future__ import annotations

from urbihw.kernel import errors
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

TABLE = Table("Enumeration")
PROTOS = {"Enumeration": ("RangeIterable", "Container")}


@TABLE.primitive("init")
def init(world: World, this: Value, name: str, values: list) -> None:  # type: ignore[type-arg]
    """Make an enumeration with this name; each name in the list becomes a slot, whose value derives from the
    enumeration.
    """
    names = [value.s for value in values if isinstance(value, String)]
    if len(names) != len(values):
        raise errors.primitive("the values of an enumeration are given by their names, as Strings")
    members = []
    for each in names:
        member = this.clone()
        world.set_slot(member, "asString", world.string(each))
        members.append(member)
    world.set_slot(this, "name", world.string(name))
    world.set_slot(this, "asString", world.string(name))
    world.set_slot(this, "values", world.new_list(members))
    for each, member in zip(names, members, strict=True):
        world.set_slot(this, each, member)


@TABLE.primitive("asList")
def as_list(world: World, this: Value) -> Value:
    """The values, in order."""
    return world.new_list(list(world.send(this, "values").l))


@TABLE.primitive("has")
def has(world: World, this: Value, value: Value) -> bool:
    """Whether a value belongs to this enumeration."""
    return any(member is value for member in world.send(this, "values").l)


@TABLE.primitive("size")
def size(world: World, this: Value) -> int:
    """The number of values."""
    return len(world.send(this, "values").l)
