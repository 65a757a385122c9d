"""Getters and setters that a program gives to a slot: its properties ``oget`` and ``oset``.

Source: manual of Urbi 2.7, tutorial, "Getters and setters"; specs/slot.  ``get name() { }`` and ``set name(x) { }`` are
another way to write them.  Later than 2.3.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.slot import meta_of, peek_meta
from urbihw.kernel.runtime.world import World


class Setter:
    """The accessor of a slot with a setter: what is assigned goes to a function of the program."""

    __slots__ = ("_name", "_world", "function")

    def __init__(self, world: World, name: str, function: Executable) -> None:
        self._world = world
        self._name = name
        self.function = function

    def read(self, target: Any) -> Any:
        """The value of the slot: what its getter gives, or what was stored."""
        return self._world.ops.send0(target, self._name)

    def write(self, target: Any, value: Any) -> Any:
        """Call the function with the value; what it gives is stored if the slot has no getter.  Returns the value."""
        world = self._world
        given = world.invoke(self.function, target, (value,), self._name)
        if given is not world.void and not isinstance(world.ops.get_slot(target, self._name), Executable):
            obj = world.as_obj(target)
            world.ops.put(obj, self._name, given)
            meta_of(obj, self._name).accessor = self
        return value


def set_getter(world: World, this: Any, slot: str, function: Any) -> None:
    """``slot->oget = function``: reading the slot calls it.  A slot that does not exist is made.

    Raises Exception.Type for what is no function, Exception.Primitive for a slot of a device or of the library.
    """
    if not isinstance(function, Executable):
        raise world.type_error(3, function, "Executable")
    obj = world.as_obj(this)
    _check(obj, slot)
    world.ops.put(obj, slot, function)


def set_setter(world: World, this: Any, slot: str, function: Any) -> None:
    """``slot->oset = function``: assigning the slot calls it.  Raises what ``set_getter`` does."""
    if not isinstance(function, Executable):
        raise world.type_error(3, function, "Executable")
    obj = world.as_obj(this)
    _check(obj, slot)
    if slot in world.record.owed:
        world.record.guard_removal(obj, slot)
    if slot not in obj.slots:
        holder = obj.find(slot)
        world.ops.put(obj, slot, world.void if holder is None else holder.slots[slot])
    meta_of(obj, slot).accessor = Setter(world, slot, function)


def _check(obj: Any, slot: str) -> None:
    """Refuse slots whose values come from elsewhere."""
    holder = obj.find(slot)
    meta = None if holder is None else peek_meta(holder, slot)
    if meta is not None and meta.accessor is not None and not isinstance(meta.accessor, Setter):
        raise errors.primitive(f"{slot}: the values of this slot come from a device or from the library")
