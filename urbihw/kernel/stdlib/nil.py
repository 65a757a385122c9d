"""nil: an empty value that can be read and counts as false."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.support import native

NOTES = {
    "nil.isNil": "Always true.",
    "nil.asString": "The string nil.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


def install(world: World, programs: Any) -> None:
    """Make nil a Singleton whose type is its own name."""
    world.nil.set_protos([prototype(world, "Singleton")])
    world.nil.slots["type"] = world.string("nil")
    world.nil.slots["isNil"] = native(world, "isNil", lambda this: world.true, 0)
    world.nil.slots["asString"] = native(world, "asString", lambda this: world.string("nil"), 0)
