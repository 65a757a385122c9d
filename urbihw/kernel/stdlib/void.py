"""void: the absence of a value.  It has three methods; ``acceptVoid`` returns a stand-in that may be used as a
value.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.object import Plain
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.support import native

NOTES = {
    "void.isVoid": "Always true.",
    "void.acceptVoid": "A stand-in for void that may be used as a value.",
    "void.unacceptVoid": "This value.",
    "void.uid": "A string that identifies void uniquely; only the stand-in can be asked for it.",
    "void.asString": "The string void.",
    "void.asPrintable": "The string void.",
    "void.asToplevelPrintable": "The string void; the top level itself prints nothing for void.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


def install(world: World, programs: Any) -> None:
    """Install the slots of void and of its stand-in."""
    accepted = Plain(world, [])
    for void in (world.void, accepted):
        void.slots["isVoid"] = native(world, "isVoid", lambda this: world.true, 0)
        void.slots["acceptVoid"] = native(world, "acceptVoid", lambda this: accepted, 0)
        void.slots["unacceptVoid"] = native(world, "unacceptVoid", lambda this: world.void, 0)
        for name in ("asString", "asPrintable", "asToplevelPrintable"):
            void.slots[name] = native(world, name, lambda this: world.string("void"), 0)
    accepted.slots["type"] = world.string("void")
    accepted.slots["uid"] = native(world, "uid", lambda this: world.string(world.uid(this)), 0)
