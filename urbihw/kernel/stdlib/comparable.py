"""Comparable: ``==`` and ``!=``, each defined by the other."""

from __future__ import annotations

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

TABLE = Table("Comparable")


@TABLE.primitive("==")
def equal(world: World, this: Value, that: Value) -> bool:
    """``!(this != that)``."""
    return not world.send(this, "!=", that)


@TABLE.primitive("!=")
def unequal(world: World, this: Value, that: Value) -> bool:
    """``!(this == that)``."""
    return not world.send(this, "==", that)
