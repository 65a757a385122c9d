"""Orderable: all comparison operators, derived from ``<`` or ``>``, and ``==``.

Source: manual, specs/orderable.  If neither operator is defined, the manual describes an endless recursion; here the
lookup fails.
"""

from __future__ import annotations

from urbihw.kernel import errors
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

TABLE = Table("Orderable")


@TABLE.primitive("<")
def less(world: World, this: Value, that: Value) -> bool:
    """``that > this``; a class must define at least one of the two."""
    _check_defined(world, this, "<", that, ">")
    return bool(world.send(that, ">", this))


@TABLE.primitive(">")
def greater(world: World, this: Value, that: Value) -> bool:
    """``that < this``; a class must define at least one of the two."""
    _check_defined(world, this, ">", that, "<")
    return bool(world.send(that, "<", this))


def _check_defined(world: World, this: Value, name: str, that: Value, mirrored: str) -> None:
    """Raise ``lookup failed`` if neither value defines one of the operators itself."""
    own = world.classes["Orderable"].slots
    if world.get_slot(this, name) is own.get(name) and world.get_slot(that, mirrored) is own.get(mirrored):
        raise errors.lookup_failed(name, this)


@TABLE.primitive("<=")
def at_most(world: World, this: Value, that: Value) -> bool:
    """``this < that || this == that``."""
    return bool(world.send(this, "<", that)) or bool(world.ops.equal(this, that))


@TABLE.primitive(">=")
def at_least(world: World, this: Value, that: Value) -> bool:
    """``this > that || this == that``."""
    return bool(world.send(this, ">", that)) or bool(world.ops.equal(this, that))
