"""The verbs of generated code that declare slots, change values in place, and read or write properties."""

from __future__ import annotations

import sys
from collections.abc import Callable
from operator import add, mul, sub, truediv
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import failed_in_code
from urbihw.kernel.runtime.slot import meta_of
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.verbs import locals_of
from urbihw.kernel.runtime.watch import Box
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World


def _counted_given() -> int:
    def count(given: Any) -> int:
        return sys.getrefcount(given)

    held = Box(None)
    return count(held)


SOLE_ARGUMENT_REFS: Final = _counted_given()
"""The number of references to an argument of a verb when only one local variable refers to the value: the minimum."""

ARITHMETIC: Final[dict[str, Callable[[float, float], float]]] = {
    "+=": add,
    "-=": sub,
    "*=": mul,
    "/=": truediv,
}


def slot_verbs(world: World) -> dict[str, Any]:
    """Declarations of slots, and access to properties and to elements of containers."""

    def declare(target: Value, name: str, value: Value) -> Value:
        """``var target.name = value``."""
        if world.ops.hooked:
            return declare_hooked(target, name, value)
        return world.set_slot(target, name, value)

    def declare_hooked(target: Value, name: str, value: Value) -> Value:
        """``declare``, where objects may have a ``createSlot`` or ``setSlot`` of their own."""
        message, args = ("createSlot", ()) if value is world.void else ("setSlot", (value,))
        hook = world.ops.hook(world.as_obj(target), message)
        if hook is None:
            return world.set_slot(target, name, value)
        return world.invoke(hook, target, (world.string(name), *args), message)

    def declare_const(target: Value, name: str, value: Value) -> Value:
        """``const var target.name = value``; a ``setSlot`` of the program may have made no slot."""
        declare(target, name, value)
        obj = world.as_obj(target)
        if name in obj.slots:
            meta_of(obj, name).constant = True
        return value

    def constant() -> None:
        """Raise the error for an assignment to a constant local variable."""
        raise errors.constness()

    def get_property(target: Value, slot: str, name: str) -> Value:
        """``target.slot->name``."""
        return world.send(target, "getProperty", world.string(slot), world.string(name))

    def set_property(target: Value, slot: str, name: str, value: Value) -> Value:
        """``target.slot->name = value``."""
        return world.send(target, "setProperty", world.string(slot), world.string(name), value)

    def get_item(target: Value, index: list[Value]) -> Value:
        """``target[index]``, read to be changed."""
        return send_named(target, "[]", *index)

    def set_item(target: Value, index: list[Value], value: Value) -> Value:
        """``target[index] = value``, where it was read to be changed."""
        return send_named(target, "[]=", *index, value)

    def send_named(target: Value, name: str, *args: Value) -> Value:
        """Send a message that is not spelled out in the program; the error of a built-in has its name."""
        try:
            return world.send(target, name, *args)
        except errors.Raised as error:
            if error.routine == "" and not failed_in_code(error):
                error.routine = name
            raise

    return locals_of(declare, declare_const, constant, get_property, set_property, get_item, set_item)


def update_verbs(world: World) -> dict[str, Any]:
    """New values for ``+=`` and the like, ``++`` and ``--``."""

    def in_place(old: Value, operator: str, value: Value) -> Value:
        """The new value for ``old operator= value``."""
        if old.__class__ is float is value.__class__ and operator in ARITHMETIC and not world.generic_floats:
            return ARITHMETIC[operator](old, value)
        return world.send(old, operator, value)

    def join(left: Value, text: str) -> Any:
        """``left + "text"``, where only the operator uses the literal."""
        if left.__class__ is String and left.protos is world.quick_strings:
            return String(world, left.protos, left.s + text)
        return left + world.string(text)

    def join_in_place(left: Value, text: str) -> Any:
        """``left += "text"``, for a local variable."""
        if left.__class__ is String and left.protos is world.quick_strings:
            if sys.getrefcount(left) == SOLE_ARGUMENT_REFS and not left.slots and left.meta is None:
                return left.grow(text)
            return String(world, left.protos, left.s + text)
        left += world.string(text)
        return left

    def step(old: Value, operator: str) -> Any:
        """The successor or predecessor of ``old``."""
        if old.__class__ is float and not world.generic_floats:
            return old + 1.0 if operator == "++" else old - 1.0
        return world.send(old, operator)

    return locals_of(in_place, join, join_in_place, step)
