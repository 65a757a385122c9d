"""Localizer: components of a robot selected by their position, ``wheel[left]`` (manual, chapter 22, "Localization").

The native half implements what urbiscript could express only by making ``[]`` slower for all objects: an index that is
looked up as a slot of Localizer before it is evaluated.  It also sends messages to all components at once,
``wheel.speed = 0``, like a Group.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from urbihw.kernel.library import CallMessage, GroupObject, LazyPrimitive, Obj, Table, Value, World, errors, prototype

TABLE = Table("Localizer")


class LocalizerObject(Obj):
    """An urbiscript Localizer; ``parts`` are in the order in which they were added."""

    __slots__ = ("parts",)
    assigns_to_members = True

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.parts: list[tuple[Any, Any]] = []

    def clone(self) -> LocalizerObject:
        """A Localizer without components."""
        return LocalizerObject(self.world, [self])

    def distribute(self, value: Value, action: Callable[[Any, Any], Any]) -> Value:
        """Call ``action(member, share)`` for all components in parallel."""
        return self.group().distribute(value, action)

    def group(self) -> GroupObject:
        """The components as a Group."""
        made = GroupObject(self.world, [self.world.classes["Group"]])
        made.members = [part for _, part in self.parts]
        return made

    def find_part(self, place: Any) -> int:
        """The index of the component at a position, -1 if there is none."""
        for index, (known, _) in enumerate(self.parts):
            if known is place or (known.__class__ is float and place.__class__ is float and known == place):
                return index
        return -1


CLASSES = {"Localizer": LocalizerObject}
PROTOS = {"Localizer": ("Component",)}


def _place(world: World, message: CallMessage) -> Value:
    """The position for an index expression: a constant of Localization by its name, otherwise the value of the
    expression.
    """
    argument = message.args[0]
    node = argument.node
    if type(node).__name__ == "Call" and node.target is None and node.args is None:
        named = prototype(world, "Localization").slots.get(node.name)
        if named is not None and world.is_a(named, prototype(world, "Localization")):
            return named
    return _checked(world, argument.force())


def _checked(world: World, place: Any) -> Any:
    """Check that a value is a position: a Localization, or a number from 0 on."""
    if place.__class__ is float:
        if place < 0 or place != int(place):
            raise errors.primitive(f"expected a number from 0, given {world.printable(place)}")
        return place
    if not world.is_a(place, prototype(world, "Localization")):
        known = ", ".join(_names(world))
        raise errors.primitive(f"no place {world.printable(place)}; there are {known}, and numbers from 0")
    return place


def _names(world: World) -> list[str]:
    proto = prototype(world, "Localization")
    return [name for name, value in sorted(proto.slots.items()) if world.is_a(value, proto)]


@TABLE.primitive("get")
def get(world: World, this: LocalizerObject, place: Any) -> Value:
    """The component at a position, a Localization or a number."""
    index = this.find_part(_checked(world, place))
    if index < 0:
        known = " ".join(f"[{world.text(place)}]" for place, _ in this.parts) or "none"
        name = world.text(world.send(this, "fullName"))
        raise errors.primitive(f"{name} has no part [{world.text(place)}]; it has {known}")
    return this.parts[index][1]


@TABLE.primitive("has")
def has(world: World, this: LocalizerObject, place: Any) -> bool:
    """Whether there is a component at a position."""
    return this.find_part(_checked(world, place)) >= 0


@TABLE.primitive("put")
def put(world: World, this: LocalizerObject, place: Any, part: Any) -> Value:
    """Store the component for a position without the checks of ``set``; returns the component."""
    index = this.find_part(_checked(world, place))
    if index < 0:
        this.parts.append((place, part))
    else:
        this.parts[index] = (place, part)
    return part


@TABLE.primitive("places")
def places(world: World, this: LocalizerObject) -> Value:
    """The positions with a component, in the order in which they were added."""
    return world.new_list([place for place, _ in this.parts])


@TABLE.primitive("load")
def load(world: World, this: LocalizerObject, *args: Value) -> Value:
    """The Group of ``load`` of each component, for motors their power."""
    return world.send(this.group(), "load", *args)


@TABLE.primitive("asGroup")
def as_group(world: World, this: LocalizerObject) -> Value:
    """The components as a Group."""
    return this.group()


def install(world: World, programs: Any) -> None:
    """Install ``[]``, its assignment and ``fallback``.  Only ``fallback`` counts as a lazy name (see the module's
    description).
    """
    proto = prototype(world, "Localizer")

    def read(message: CallMessage) -> Value:
        return get(world, message.target, _place(world, message))

    def write(message: CallMessage) -> Value:
        return world.send(message.target, "set", _place(world, message), message.args[1].force())

    def fallback(message: CallMessage) -> Value:
        this = message.target
        if not this.parts:
            raise errors.lookup_failed(message.message)
        return world.send(this.group(), message.message, *[argument.force() for argument in message.args])

    proto.slots["[]"] = LazyPrimitive(world, "[]", read, 1, 1)
    proto.slots["[]="] = LazyPrimitive(world, "[]=", write, 2, 2)
    proto.slots["fallback"] = LazyPrimitive(world, "fallback", fallback, 0, -1)
