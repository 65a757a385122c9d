"""Loadable: what can be switched on and off."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype

TABLE = Table("Loadable")

NOTES = {
    "Loadable.load": "Whether it is switched on.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


def _set(world: World, this: Any, on: bool) -> Any:
    world.update_slot(this, "load", world.boolean(on))
    return this


@TABLE.primitive("on")
def on(world: World, this: Any, value: Any = None) -> Any:
    """Set ``load`` to true; returns this.  The argument is ignored."""
    return _set(world, this, True)


@TABLE.primitive("off")
def off(world: World, this: Any, value: Any = None) -> Any:
    """Set ``load`` to false; returns this.  The argument is ignored."""
    return _set(world, this, False)


@TABLE.primitive("toggle")
def toggle(world: World, this: Any) -> Any:
    """Change ``load``; returns this."""
    return _set(world, this, not world.send(this, "load"))


def install(world: World, programs: Any) -> None:
    """``load`` is false until somebody switches on."""
    prototype(world, "Loadable").slots["load"] = world.false
