"""nil: an empty value, which can be read, and counts as false."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.support import native

NOTES = {
    "nil.isNil": "True.",
    "nil.asString": "nil.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


def install(world: World, programs: Any) -> None:
    """Make nil a Singleton that calls itself nil."""
    world.nil.set_protos([prototype(world, "Singleton")])
    world.nil.slots["type"] = world.string("nil")
    world.nil.slots["isNil"] = native(world, "isNil", lambda this: world.true, 0)
    world.nil.slots["asString"] = native(world, "asString", lambda this: world.string("nil"), 0)
