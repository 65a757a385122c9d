"""true and false."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.object import Truth
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import CallMessage
from urbihw.kernel.runtime.world import World

TABLE = Table("Boolean")
PROTOS = {"Boolean": ("Singleton",)}

NOTES = {
    "Boolean": "Truth values: true and false.",
    "true": "What holds.",
    "false": "What does not hold.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


@TABLE.primitive("asString")
def as_string(world: World, this: Any) -> str:
    """``true`` or ``false``; the prototype of both says its name."""
    if not isinstance(this, Truth):
        return "Boolean"
    return "true" if this.value else "false"


@TABLE.primitive("asBool")
def as_bool(world: World, this: Truth) -> Any:
    """This."""
    return this


@TABLE.primitive("!")
def not_(world: World, this: Truth) -> bool:
    """The other one."""
    return not this.value


@TABLE.lazy("&&", least=1, most=1)
def and_(world: World, message: CallMessage) -> Any:
    """The argument, evaluated only if this is true; else this."""
    return message.eval_at(0) if message.target else message.target


@TABLE.lazy("||", least=1, most=1)
def or_(world: World, message: CallMessage) -> Any:
    """This if it is true; else the argument, evaluated only then."""
    return message.target or message.eval_at(0)


def install(world: World, programs: Any) -> None:
    """Give both their own names."""
    world.true.slots["type"] = world.string("true")
    world.false.slots["type"] = world.string("false")
