"""Finalizable, WeakPointer and WeakDictionary: the end of objects without references.

Source: manual, specs/finalizable; release notes for the weak classes, which the manual does not describe.  Python
counts references as the original does, so an object ends immediately with its last reference.
"""

from __future__ import annotations

import itertools
import weakref
from typing import Any

from urbihw.kernel.runtime.backtrace import calling_frame
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.dictionary import missing
from urbihw.kernel.value import Value

FINALIZABLE = Table("Finalizable")
POINTER = Table("WeakPointer")
DICTIONARY = Table("WeakDictionary")
TABLES = [FINALIZABLE, POINTER, DICTIONARY]

NOTES = {
    "Finalizable": "An object whose finalize is called when its last reference disappears.",
    "WeakPointer": "A reference that does not keep its object alive.",
    "WeakDictionary": "A Dictionary whose entries disappear when there is no other reference to their values.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class FinalizableObject(Obj):
    """An urbiscript Finalizable: its ``finalize`` runs in a job of its own when the last reference goes.

    Python ends the members of a list from the last to the first, the original from the first to the last.  So objects
    that one instruction of a program ends are finalized in the order in which they were made.
    """

    __slots__ = ("_context", "_number")
    requires_finalizable_heirs = True

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        current = world.scheduler.current
        self._context: Any = None if current is None else current.context
        self._number = next(_endings(world).numbers)

    def clone(self) -> FinalizableObject:
        return FinalizableObject(self.world, [self])

    def __del__(self) -> None:
        world = self.world
        if world.scheduler.abandoned:
            return  # nothing runs any more, and the job would keep the whole kernel
        frame, context = calling_frame(), self._context
        ended = _endings(world).at((id(frame), 0 if frame is None else frame.f_lasti, id(context)))
        ended.append(self)

        def finalize_next() -> None:
            ended.sort(key=lambda each: -each._number)
            world.send(ended.pop(), "finalize")

        world.scheduler.spawn(finalize_next, "finalize", context=context)


class Endings:
    """The Finalizables of one world that ended together and are not finalized yet."""

    def __init__(self) -> None:
        self.numbers = itertools.count()
        self._instruction: tuple[int, ...] = ()
        self._ended: list[FinalizableObject] = []

    def at(self, instruction: tuple[int, ...]) -> list[FinalizableObject]:
        """The objects that an instruction has ended so far."""
        if instruction != self._instruction:
            self._instruction, self._ended = instruction, []
        return self._ended


def _endings(world: World) -> Endings:
    if not world.has_part(Endings):
        world.install_part(Endings())
    return world.part(Endings)


@FINALIZABLE.primitive("finalize")
def finalize(world: World, this: FinalizableObject) -> None:
    """Called when the last reference to the object disappears; does nothing unless redefined."""


# ---------------------------------------------------------------- WeakPointer


class WeakPointerObject(Obj):
    """An urbiscript WeakPointer, which does not keep its target."""

    __slots__ = ("pointed",)

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.pointed: weakref.ref[Obj] | None = None

    def clone(self) -> WeakPointerObject:
        """A pointer to the same object."""
        made = WeakPointerObject(self.world, [self])
        made.pointed = self.pointed
        return made


@POINTER.primitive("init", "set")
def point(world: World, this: WeakPointerObject, value: Obj | None = None) -> None:
    """Point to an object, or to nothing."""
    this.pointed = None if value is None else weakref.ref(value)


@POINTER.primitive("get", "getNow")
def pointed(world: World, this: WeakPointerObject) -> Value:
    """The object, nil if it does not exist any more."""
    value = None if this.pointed is None else this.pointed()
    return world.nil if value is None else value


# ---------------------------------------------------------------- WeakDictionary


class WeakDictionaryObject(Obj):
    """An urbiscript WeakDictionary: a key is removed when its value disappears."""

    __slots__ = ("d",)

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.d: weakref.WeakValueDictionary[str, Obj] = weakref.WeakValueDictionary()

    def clone(self) -> WeakDictionaryObject:
        return WeakDictionaryObject(self.world, [self])


CLASSES = {
    "Finalizable": FinalizableObject,
    "WeakPointer": WeakPointerObject,
    "WeakDictionary": WeakDictionaryObject,
}


@DICTIONARY.primitive("set", "[]=")
def set_(world: World, this: WeakDictionaryObject, key: str, value: Obj) -> Value:
    """Map a key to an object without keeping a reference to it; returns the object."""
    this.d[key] = value
    return value


@DICTIONARY.primitive("get", "[]")
def get(world: World, this: WeakDictionaryObject, key: str) -> Value:
    """The object of a key.  Raises Dictionary.KeyError if there is none."""
    value = this.d.get(key)
    if value is None:
        raise missing(world, world.string(key))
    return value


@DICTIONARY.primitive("has")
def has(world: World, this: WeakDictionaryObject, key: str) -> bool:
    """Whether the key has an object that still exists."""
    return key in this.d


@DICTIONARY.primitive("erase")
def erase(world: World, this: WeakDictionaryObject, key: str) -> Value:
    """Remove a key; returns this dictionary."""
    this.d.pop(key, None)
    return this


@DICTIONARY.primitive("keys")
def keys(world: World, this: WeakDictionaryObject) -> Value:
    """The keys whose objects still exist, in order."""
    return world.new_list([world.string(key) for key in sorted(this.d.keys())])
