"""Finalizable, WeakPointer and WeakDictionary: what happens when nobody refers to an object any more.

Source: manual, specs/finalizable; release notes for the weak ones, which the manual does not describe.  Python counts
references as the original did, so the end of an object comes at once.
"""

from __future__ import annotations

import weakref
from typing import Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.dictionary import missing

FINALIZABLE = Table("Finalizable")
POINTER = Table("WeakPointer")
DICTIONARY = Table("WeakDictionary")
TABLES = [FINALIZABLE, POINTER, DICTIONARY]

NOTES = {
    "Finalizable": "An object whose finalize is called when nobody refers to it any more.",
    "WeakPointer": "A reference that keeps nothing alive.",
    "WeakDictionary": "A Dictionary whose values may vanish when nobody else refers to them.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class FinalizableObject(Obj):
    """An urbiscript Finalizable: its ``finalize`` runs in a job of its own when the last reference goes."""

    __slots__ = ("_context",)
    heirs_alike = True

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        current = world.scheduler.current
        self._context: Any = None if current is None else current.context

    def clone(self) -> FinalizableObject:
        """A Finalizable of its own."""
        return FinalizableObject(self.world, [self])

    def __del__(self) -> None:
        world = self.world
        world.scheduler.spawn(lambda: world.send(self, "finalize"), "finalize", context=self._context)


@FINALIZABLE.primitive("finalize")
def finalize(world: World, this: FinalizableObject) -> None:
    """Called when the object is about to go; does nothing unless redefined."""


# ---------------------------------------------------------------- WeakPointer


class WeakPointerObject(Obj):
    """An urbiscript WeakPointer."""

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
def pointed(world: World, this: WeakPointerObject) -> Any:
    """The object, nil if it is gone."""
    value = None if this.pointed is None else this.pointed()
    return world.nil if value is None else value


# ---------------------------------------------------------------- WeakDictionary


class WeakDictionaryObject(Obj):
    """An urbiscript WeakDictionary: forgets a key when its value goes."""

    __slots__ = ("d",)

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.d: weakref.WeakValueDictionary[str, Obj] = weakref.WeakValueDictionary()

    def clone(self) -> WeakDictionaryObject:
        """An empty one."""
        return WeakDictionaryObject(self.world, [self])


CLASSES = {
    "Finalizable": FinalizableObject,
    "WeakPointer": WeakPointerObject,
    "WeakDictionary": WeakDictionaryObject,
}


@DICTIONARY.primitive("set", "[]=")
def set_(world: World, this: WeakDictionaryObject, key: str, value: Obj) -> Any:
    """Map a key to an object, which may go all the same; gives the object."""
    this.d[key] = value
    return value


@DICTIONARY.primitive("get", "[]")
def get(world: World, this: WeakDictionaryObject, key: str) -> Any:
    """The object of a key; raises Dictionary.KeyError if there is none (any more)."""
    value = this.d.get(key)
    if value is None:
        raise missing(world, world.string(key))
    return value


@DICTIONARY.primitive("has")
def has(world: World, this: WeakDictionaryObject, key: str) -> bool:
    """Whether a key has an object that is still there."""
    return key in this.d


@DICTIONARY.primitive("erase")
def erase(world: World, this: WeakDictionaryObject, key: str) -> Any:
    """Forget a key; gives this dictionary."""
    this.d.pop(key, None)
    return this


@DICTIONARY.primitive("keys")
def keys(world: World, this: WeakDictionaryObject) -> Any:
    """The keys whose objects are still there, in order."""
    return world.new_list([world.string(key) for key in sorted(this.d.keys())])
