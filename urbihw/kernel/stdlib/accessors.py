"""Getters and setters of slots, made by programs: the properties ``oget`` and ``oset``.

Source: manual of Urbi 2.7, tutorial, "Getters and setters"; specs/slot.  ``get name() { }`` and ``set name(x) { }`` are
an equivalent syntax.  Later than 2.3.
"""

from __future__ import annotations

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.slot import meta_of, peek_meta
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value


class Setter:
    """The accessor of a slot with a setter: an assignment calls a function of the program."""

    __slots__ = ("_name", "_world", "function")

    def __init__(self, world: World, name: str, function: Executable) -> None:
        self._world = world
        self._name = name
        self.function = function

    def read(self, target: Value) -> Value:
        """The value of the slot: the result of its getter, or the stored value."""
        return self._world.ops.send0(target, self._name)

    def write(self, target: Value, value: Value) -> Value:
        """Call the function with the value; its result is stored if the slot has no getter.  Returns the value."""
        world = self._world
        given = world.invoke(self.function, target, (value,), self._name)
        if given is not world.void and not isinstance(world.ops.get_slot(target, self._name), Executable):
            obj = world.as_obj(target)
            world.ops.put_slot(obj, self._name, given)
            meta_of(obj, self._name).accessor = self
        return value


def set_getter(world: World, this: Value, slot: str, function: Value) -> None:
    """``slot->oget = function``: a read of the slot calls the function.  A slot that does not exist is made.

    Raises Exception.Type if ``function`` is no function, Exception.Primitive for a slot of a device or of the library.
    """
    if not isinstance(function, Executable):
        raise world.type_error(3, function, "Executable")
    obj = world.as_obj(this)
    _check(obj, slot)
    world.ops.put_slot(obj, slot, function)
    meta_of(obj, slot).getter = True


def set_setter(world: World, this: Value, slot: str, function: Value) -> None:
    """``slot->oset = function``: an assignment to the slot calls the function.  Raises the same errors as
    ``set_getter``.
    """
    if not isinstance(function, Executable):
        raise world.type_error(3, function, "Executable")
    obj = world.as_obj(this)
    _check(obj, slot)
    if slot in world.record.protected:
        world.record.guard_removal(obj, slot)
    if slot not in obj.slots:
        holder = obj.find(slot)
        world.ops.put_slot(obj, slot, world.void if holder is None else holder.slots[slot])
    meta_of(obj, slot).accessor = Setter(world, slot, function)


def _check(obj: Value, slot: str) -> None:
    """Raise the error for a slot that cannot have accessors."""
    holder = obj.find(slot)
    meta = None if holder is None else peek_meta(holder, slot)
    if meta is not None and meta.accessor is not None and not isinstance(meta.accessor, Setter):
        raise errors.primitive(f"{slot}: the values of this slot come from a device or from the library")
