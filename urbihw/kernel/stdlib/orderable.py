"""Orderable: all comparisons from ``<`` or ``>``, with ``==``.

Source: manual, specs/orderable.  Where it speaks of endless recursions, because neither is defined, a look-up fails.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World

TABLE = Table("Orderable")


@TABLE.primitive("<")
def less(world: World, this: Any, that: Any) -> bool:
    """``that > this``: define at least one of both."""
    _check_defined(world, this, "<", that, ">")
    return bool(world.send(that, ">", this))


@TABLE.primitive(">")
def greater(world: World, this: Any, that: Any) -> bool:
    """``that < this``: define at least one of both."""
    _check_defined(world, this, ">", that, "<")
    return bool(world.send(that, "<", this))


def _check_defined(world: World, this: Any, name: str, that: Any, mirrored: str) -> None:
    """Raises ``lookup failed`` where both values have nothing but what is defined here."""
    own = world.classes["Orderable"].slots
    if world.get_slot(this, name) is own.get(name) and world.get_slot(that, mirrored) is own.get(mirrored):
        raise errors.lookup_failed(name, this)


@TABLE.primitive("<=")
def at_most(world: World, this: Any, that: Any) -> bool:
    """``this < that || this == that``."""
    return bool(world.send(this, "<", that)) or bool(world.ops.equal(this, that))


@TABLE.primitive(">=")
def at_least(world: World, this: Any, that: Any) -> bool:
    """``this > that || this == that``."""
    return bool(world.send(this, ">", that)) or bool(world.ops.equal(this, that))
