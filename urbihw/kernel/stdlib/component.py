"""Component: a node of a robot's structure tree, implemented in urbiscript (manual, chapter 22).

The native half stores the compact names: those of the robot belong to the library, whoever has them made.
"""

from __future__ import annotations

from typing import Final

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import Dictionary
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

PROTOS = {"Component": ("Object",), "Localization": ("Object",)}
"""Made here because Localizer, which has a native half, derives from them before any urbiscript runs."""
TABLE = Table("Component")
ROBOT: Final = "robot"
"""The slot of Global with the robot (manual, chapter 22)."""


@TABLE.primitive("storeNames")
def store_names(world: World, this: Value, made: Dictionary) -> None:
    """Store each part of a Dictionary in the slot of Global with its name.

    The names of the robot's own tree become part of the library's record: no later check takes them for damage.  Raises
    ``cannot modify const slot`` if a name is taken by a protected slot with another value.
    """
    slots = world.global_.slots

    def store() -> None:
        for name, part in made.d.items():
            if slots.get(name) is part:
                continue
            if name in slots:
                world.ops.update_slot(world.global_, name, part)
            else:
                world.ops.set_slot(world.global_, name, part)

    if slots.get(ROBOT) is this:
        world.record.adopt(store)
    else:
        store()
