"""The truth values true and false: singletons with the same slots.

There is no object Boolean (manual, specs/boolean).
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.object import Truth
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import CallMessage
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

TABLE = Table("true")
PROTOS = {"true": ("Singleton",), "false": ("Singleton",)}

NOTES = {
    "true": "The truth value of a condition that is met; false has the same slots.",
    "false": "The truth value of a condition that is not met; see true.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


@TABLE.primitive("asString")
def as_string(world: World, this: Truth) -> str:
    """``true`` or ``false``."""
    return "true" if this.value else "false"


@TABLE.primitive("asBool")
def as_bool(world: World, this: Truth) -> Value:
    """Returns this value itself."""
    return this


@TABLE.primitive("!")
def not_(world: World, this: Truth) -> bool:
    """The opposite truth value."""
    return not this.value


@TABLE.lazy("&&", least=1, most=1)
def and_(world: World, message: CallMessage) -> Value:
    """This value if it is false; otherwise the argument, which is evaluated only then."""
    return message.eval_at(0) if message.target else message.target


@TABLE.lazy("||", least=1, most=1)
def or_(world: World, message: CallMessage) -> Value:
    """This value if it is true; otherwise the argument, which is evaluated only then."""
    return message.target or message.eval_at(0)


def install(world: World, programs: Any) -> None:
    """Give false the slots of true, and both their own names as ``type``."""
    TABLE.install(world, world.false)
    world.true.slots["type"] = world.string("true")
    world.false.slots["type"] = world.string("false")
