"""Loadable: an object that can be switched on and off."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.value import Value

TABLE = Table("Loadable")

NOTES = {
    "Loadable.load": "Whether the object is switched on.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


def _set(world: World, this: Value, on: bool) -> Value:
    world.update_slot(this, "load", world.boolean(on))
    return this


@TABLE.primitive("on")
def on(world: World, this: Value, value: Value = None) -> Value:
    """Set ``load`` to true; returns this object.  The argument is ignored."""
    return _set(world, this, True)


@TABLE.primitive("off")
def off(world: World, this: Value, value: Value = None) -> Value:
    """Set ``load`` to false; returns this object.  The argument is ignored."""
    return _set(world, this, False)


@TABLE.primitive("toggle")
def toggle(world: World, this: Value) -> Value:
    """Invert ``load``; returns this object."""
    return _set(world, this, not world.send(this, "load"))


def install(world: World, programs: Any) -> None:
    """Make the slot ``load``, initially false."""
    prototype(world, "Loadable").slots["load"] = world.false
