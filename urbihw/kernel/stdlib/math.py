"""Math: the functions of Float in mathematical notation."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

TABLE = Table("Math")
PROTOS = {"Math": ("Singleton",)}

_OF_ONE = (
    "abs", "acos", "asin", "atan", "cos", "exp", "log", "random", "round", "sign", "sin", "sqr", "sqrt", "srandom",
    "tan", "trunc",
)  # fmt: skip


def _bounce(name: str) -> None:
    def make(world: World) -> Any:
        return lambda this, value: world.send(value, name)

    make.__doc__ = f"``value.{name}``."
    TABLE.raw(name, least=1)(make)


for _name in _OF_ONE:
    _bounce(_name)


def _constant(name: str) -> None:
    def make(world: World) -> Any:
        return lambda this: world.send(world.float_proto, name)

    make.__doc__ = f"``Float.{name}``."
    TABLE.raw(name, least=0)(make)


for _name in ("inf", "nan", "pi"):
    _constant(_name)


@TABLE.primitive("atan2")
def atan2(world: World, this: Value, y: Value, x: Value) -> Value:
    """``y.atan2(x)``: the angle of the point (x, y), in radians."""
    return world.send(y, "atan2", x)


@TABLE.primitive("max")
def max_(world: World, this: Value, *values: Value) -> Value:
    """The maximum of the arguments: ``[...].max``."""
    return world.send(world.new_list([*values]), "max")


@TABLE.primitive("min")
def min_(world: World, this: Value, *values: Value) -> Value:
    """The minimum of the arguments: ``[...].min``."""
    return world.send(world.new_list([*values]), "min")
