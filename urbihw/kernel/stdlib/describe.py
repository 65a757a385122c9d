"""Object: descriptions for users: ``print``, ``inspect`` and ``dump``."""

from __future__ import annotations

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.properties import own_properties
from urbihw.kernel.stdlib.support import send_line
from urbihw.kernel.value import Value

TABLE = Table("Object")


@TABLE.primitive("print")
def print_(world: World, this: Value) -> None:
    """Print this value as the top level does."""
    send_line(world, world.text(world.send(this, "asToplevelPrintable")))


@TABLE.primitive("inspect")
def inspect(world: World, this: Value, deep: bool = False) -> None:
    """Print the prototypes and the slots of this object with their types and properties: its own slots or, if ``deep``,
    all.
    """
    lines = [f"Inspecting {world.printable(this)}", "** Prototypes:"]
    lines += [f"  {world.printable(proto)}" for proto in world.protos_of(this)]
    lines.append("** Slots:" if deep else "** Local Slots:")
    names = world.send(this, "slotNames" if deep else "localSlotNames")
    for name in sorted((member.s for member in names.l), key=str.lower):
        lines += _inspect_slot(world, this, name)
    for line in lines:
        send_line(world, f"*** {line}")


def _inspect_slot(world: World, this: Value, name: str) -> list[str]:
    lines = [f"  {name} : {_type(world, world.get_slot(this, name))}"]
    holder = world.peek_obj(this).find(name)
    properties = own_properties(world, holder, name)
    if properties:
        lines.append("    Properties:")
    for key, value in sorted(properties.items()):
        lines.append(f"     {key} : {_type(world, value)} = {world.printable(value)}")
    return lines


def _type(world: World, value: Value) -> str:
    """The type of a slot's value, without calling the value."""
    if value is world.void:
        return "void"
    kind = world.get_slot(value, "type")
    return str(kind.s) if isinstance(kind, String) else world.type_name(value)


@TABLE.primitive("dump")
def dump(world: World, this: Value, depth: int) -> None:
    """Print a full description of this object and, down to ``depth``, of the values of its slots."""
    for line in _dump(world, this, depth, ""):
        send_line(world, f"*** {line}")


def _dump(world: World, value: Value, depth: int, margin: str) -> list[str]:
    inner = margin + "  "
    lines = [f"{_title(world, value)} {{", f"{inner}/* Special slots */"]
    protos = ", ".join(_type(world, proto) for proto in world.protos_of(value))
    lines.append(f"{inner}protos = {protos}")
    if value.__class__ is float:
        lines.append(f"{inner}value = {world.printable(value)}")
    lines.append(f"{inner}/* Slots */")
    obj = world.peek_obj(value)
    if value.__class__ is not float or id(value) in world.float_slots:
        for name in sorted(obj.slots, key=str.lower):
            lines += _dump_slot(world, obj, name, depth, inner)
    lines.append(f"{inner}}}")
    return lines


def _dump_slot(world: World, obj: Obj, name: str, depth: int, margin: str) -> list[str]:
    lines = _entry(world, name, obj.slots[name], depth, margin, margin)
    properties = own_properties(world, obj, name)
    if properties:
        lines.append(f"{margin}  /* Properties */")
    for key, value in sorted(properties.items()):
        lines += _entry(world, key, value, depth, margin + "  ", margin + "  ")
    return lines


def _entry(world: World, name: str, value: Value, depth: int, margin: str, inner: str) -> list[str]:
    if depth <= 0 or value is world.void:
        return [f"{margin}{name} = {_title(world, value)} <...>"]
    first, *rest = _dump(world, value, depth - 1, inner)
    return [f"{margin}{name} = {first}", *rest]


def _title(world: World, value: Value) -> str:
    return f"{_type(world, value)}_{world.uid(value)}"
