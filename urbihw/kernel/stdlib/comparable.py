"""Comparable: ``==`` and ``!=``, each from the other."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World

TABLE = Table("Comparable")


@TABLE.primitive("==")
def equal(world: World, this: Any, that: Any) -> bool:
    """``!(this != that)``."""
    return not world.send(this, "!=", that)


@TABLE.primitive("!=")
def unequal(world: World, this: Any, that: Any) -> bool:
    """``!(this == that)``."""
    return not world.send(this, "==", that)
