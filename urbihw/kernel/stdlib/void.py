"""void: no value.  It understands three messages; ``acceptVoid`` gives a stand-in that may be used as a value."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.object import Plain
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.support import native

NOTES = {
    "void.isVoid": "True.",
    "void.acceptVoid": "A stand-in for void that may be used as a value.",
    "void.unacceptVoid": "void.",
    "void.asString": "void.",
    "void.asPrintable": "void.",
    "void.asToplevelPrintable": "Nothing is shown of void.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


def install(world: World, programs: Any) -> None:
    """Give void and its stand-in the slots they answer to."""
    accepted = Plain(world, [])
    for void in (world.void, accepted):
        void.slots["isVoid"] = native(world, "isVoid", lambda this: world.true, 0)
        void.slots["acceptVoid"] = native(world, "acceptVoid", lambda this: accepted, 0)
        void.slots["unacceptVoid"] = native(world, "unacceptVoid", lambda this: world.void, 0)
        for name in ("asString", "asPrintable", "asToplevelPrintable"):
            void.slots[name] = native(world, name, lambda this: world.string("void"), 0)
    accepted.slots["type"] = world.string("void")
