"""Orderable: all comparisons from ``<`` or ``>``, with ``==``."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World

TABLE = Table("Orderable")


@TABLE.primitive("<")
def less(world: World, this: Any, that: Any) -> bool:
    """``that > this``: define at least one of both."""
    return bool(world.send(that, ">", this))


@TABLE.primitive(">")
def greater(world: World, this: Any, that: Any) -> bool:
    """``that < this``: define at least one of both."""
    return bool(world.send(that, "<", this))


@TABLE.primitive("<=")
def at_most(world: World, this: Any, that: Any) -> bool:
    """``this < that || this == that``."""
    return bool(world.send(this, "<", that)) or bool(world.ops.equal(this, that))


@TABLE.primitive(">=")
def at_least(world: World, this: Any, that: Any) -> bool:
    """``this > that || this == that``."""
    return bool(world.send(this, ">", that)) or bool(world.ops.equal(this, that))
