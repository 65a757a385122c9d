"""Container: ``has`` and ``hasNot``, each defined by the other; ``in`` and ``not in`` call them."""

from __future__ import annotations

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

TABLE = Table("Container")


@TABLE.primitive("has")
def has(world: World, this: Value, member: Value) -> bool:
    """``!hasNot(member)``."""
    return not world.send(this, "hasNot", member)


@TABLE.primitive("hasNot")
def has_not(world: World, this: Value, member: Value) -> bool:
    """``!has(member)``."""
    return not world.send(this, "has", member)
