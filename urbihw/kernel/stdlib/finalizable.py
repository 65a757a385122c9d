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

    __slots__ = ("_context", "number")
    requires_finalizable_heirs = True

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        current = world.scheduler.current
        self._context: Any = None if current is None else current.context
        self.number = next(_endings(world).numbers)
        """The place in the order in which objects were made."""

    def clone(self) -> FinalizableObject:
        return FinalizableObject(self.world, [self])

    def __del__(self) -> None:
        world = self.world
        if world.scheduler.abandoned:
            return  # nothing runs any more, and the job would keep the whole kernel
        frame, context = calling_frame(), self._context
        ending = FinalizableEnding(self)
        _endings(world).add(ending, (id(frame), 0 if frame is None else frame.f_lasti, id(context)))
        world.scheduler.spawn(ending.finalize, "finalize", context=context)


class FinalizableEnding:
    """A Finalizable that has ended, held by the job that finalizes it.  A refused or stopped job frees both."""

    __slots__ = ("__weakref__", "finalizable", "together")

    def __init__(self, finalizable: FinalizableObject) -> None:
        self.finalizable = finalizable
        self.together: list[weakref.ref[FinalizableEnding]] = []
        """The endings by the same instruction, in the order of their jobs; empty once they are in order."""

    def finalize(self) -> None:
        """Finalize the object whose turn it is."""
        if self.together:
            self._put_in_order()
        self.finalizable.world.send(self.finalizable, "finalize")

    def _put_in_order(self) -> None:
        """Let the jobs of objects that ended together exchange them: the first job gets the object made first."""
        endings = [ending for each in self.together if (ending := each()) is not None]
        self.together.clear()
        finalizables = sorted((each.finalizable for each in endings), key=lambda each: each.number)
        for each, finalizable in zip(endings, finalizables, strict=True):
            each.finalizable = finalizable


class Endings:
    """The Finalizables of one world that ended together and are not finalized yet."""

    def __init__(self) -> None:
        self.numbers = itertools.count()
        self._instruction: tuple[int, ...] = ()
        self._together: list[weakref.ref[FinalizableEnding]] = []

    def add(self, ending: FinalizableEnding, instruction: tuple[int, ...]) -> None:
        """Put an object with those that the same instruction has ended so far."""
        if instruction != self._instruction:
            self._instruction, self._together = instruction, []
        self._together.append(weakref.ref(ending))
        ending.together = self._together


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
