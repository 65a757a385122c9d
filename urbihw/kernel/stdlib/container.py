"""Container: ``has`` and ``hasNot``, each from the other; they are what ``in`` and ``not in`` mean."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World

TABLE = Table("Container")


@TABLE.primitive("has")
def has(world: World, this: Any, member: Any) -> bool:
    """``!hasNot(member)``."""
    return not world.send(this, "hasNot", member)


@TABLE.primitive("hasNot")
def has_not(world: World, this: Any, member: Any) -> bool:
    """``!has(member)``."""
    return not world.send(this, "has", member)
