"""Localizer: parts of a robot told apart by where they are, ``wheel[left]`` (manual, chapter 22, "Localization").

The native half is what urbiscript cannot say without making ``[]`` slower for everybody: an index that is looked up as
a slot of Localizer before it is evaluated; and messages to all parts at once, ``wheel.speed = 0``, as to a Group.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import LazyPrimitive
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import CallMessage
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.group import GroupObject

TABLE = Table("Localizer")


class LocalizerObject(Obj):
    """An urbiscript Localizer; ``parts`` are in the order in which they were set."""

    __slots__ = ("parts",)
    bounces = True

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.parts: list[tuple[Any, Any]] = []

    def clone(self) -> LocalizerObject:
        """A Localizer without parts."""
        return LocalizerObject(self.world, [self])

    def distribute(self, value: Any, action: Callable[[Any, Any], Any]) -> Any:
        """Do something with all parts at the same time."""
        return self.group().distribute(value, action)

    def group(self) -> GroupObject:
        """The parts as a Group."""
        made = GroupObject(self.world, [self.world.classes["Group"]])
        made.members = [part for _, part in self.parts]
        return made

    def find_part(self, place: Any) -> int:
        """The index of the part at a place, -1 if there is none."""
        for index, (known, _) in enumerate(self.parts):
            if known is place or (known.__class__ is float and place.__class__ is float and known == place):
                return index
        return -1


CLASSES = {"Localizer": LocalizerObject}
PROTOS = {"Localizer": ("Component",)}


def _place(world: World, message: CallMessage) -> Any:
    """The place meant by an index: a constant of Localization by its name, else what it evaluates to."""
    argument = message.args[0]
    node = argument.node
    if type(node).__name__ == "Call" and node.target is None and node.args is None:
        named = prototype(world, "Localization").slots.get(node.name)
        if named is not None and world.is_a(named, prototype(world, "Localization")):
            return named
    return _checked(world, argument.force())


def _checked(world: World, place: Any) -> Any:
    """A place: a Localization or a number from 0."""
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
def get(world: World, this: LocalizerObject, place: Any) -> Any:
    """The part at a place, a Localization or a number."""
    index = this.find_part(_checked(world, place))
    if index < 0:
        known = " ".join(f"[{world.text(place)}]" for place, _ in this.parts) or "none"
        name = world.text(world.send(this, "fullName"))
        raise errors.primitive(f"{name} has no part [{world.text(place)}]; it has {known}")
    return this.parts[index][1]


@TABLE.primitive("has")
def has(world: World, this: LocalizerObject, place: Any) -> bool:
    """Whether there is a part at a place."""
    return this.find_part(_checked(world, place)) >= 0


@TABLE.primitive("put")
def put(world: World, this: LocalizerObject, place: Any, part: Any) -> Any:
    """Set the part at a place, without the checks of ``set``; gives the part."""
    index = this.find_part(_checked(world, place))
    if index < 0:
        this.parts.append((place, part))
    else:
        this.parts[index] = (place, part)
    return part


@TABLE.primitive("places")
def places(world: World, this: LocalizerObject) -> Any:
    """The places where there is a part, in the order in which they were set."""
    return world.new_list([place for place, _ in this.parts])


@TABLE.primitive("asGroup")
def as_group(world: World, this: LocalizerObject) -> Any:
    """The parts as a Group."""
    return this.group()


def install(world: World, programs: Any) -> None:
    """``[]``, its assignment and ``fallback``, of which only ``fallback`` counts as a lazy name: see above."""
    proto = prototype(world, "Localizer")

    def read(message: CallMessage) -> Any:
        return get(world, message.target, _place(world, message))

    def write(message: CallMessage) -> Any:
        return world.send(message.target, "set", _place(world, message), message.args[1].force())

    def fallback(message: CallMessage) -> Any:
        this = message.target
        if not this.parts:
            raise errors.lookup_failed(message.message)
        return world.send(this.group(), message.message, *[argument.force() for argument in message.args])

    proto.slots["[]"] = LazyPrimitive(world, "[]", read, 1, 1)
    proto.slots["[]="] = LazyPrimitive(world, "[]=", write, 2, 2)
    proto.slots["fallback"] = LazyPrimitive(world, "fallback", fallback, 0, -1)
