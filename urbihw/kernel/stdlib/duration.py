"""Duration: a number of seconds, printed with its unit."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.plain import float_text
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import FloatObject
from urbihw.kernel.runtime.world import World

TABLE = Table("Duration")
PROTOS = {"Duration": ("Float",)}


class DurationObject(FloatObject):
    """An urbiscript Duration; ``value`` is in seconds."""

    __slots__ = ()

    def __init__(self, world: World, protos: list[Obj], value: float = 0.0) -> None:
        super().__init__(world, protos, value)

    def clone(self) -> DurationObject:
        """A new Duration of the same length."""
        return DurationObject(self.world, [self], self.value)


CLASSES = {"Duration": DurationObject}


def make_duration(world: World, seconds: float) -> DurationObject:
    """Make a Duration from seconds."""
    proto: Any = world.classes["Duration"]
    return DurationObject(world, [proto], seconds)


@TABLE.primitive("init")
def init(world: World, this: DurationObject, seconds: float = 0.0) -> None:
    """Make a Duration of a number of seconds, which may be negative; the default is 0."""
    this.value = seconds


@TABLE.primitive("asFloat", "seconds")
def as_float(world: World, this: DurationObject) -> float:
    """The number of seconds."""
    return this.value


@TABLE.primitive("asString")
def as_string(world: World, this: DurationObject) -> str:
    """The number of seconds, with the unit."""
    return float_text(this.value) + "s"


@TABLE.primitive("asPrintable", "asToplevelPrintable")
def as_printable(world: World, this: DurationObject) -> str:
    """``Duration(90s)``."""
    return f"Duration({float_text(this.value)}s)"
