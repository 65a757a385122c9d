"""Singleton: an object that cannot be cloned. nil, true and false are singletons."""

from __future__ import annotations

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

TABLE = Table("Singleton")


@TABLE.primitive("clone", "new")
def clone(world: World, this: Value) -> Value:
    """Returns this value itself."""
    return this
