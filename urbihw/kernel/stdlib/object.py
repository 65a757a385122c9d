"""Object."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World

TABLE = Table("Object")


@TABLE.primitive("asToplevelPrintable", "asPrintable", "asString")
def as_string(world: World, this: Any) -> str:
    """x."""
    if this.__class__ is float:
        return f"{this:g}"
    return getattr(this, "s", "obj")


@TABLE.primitive("echo")
def echo(world: World, this: Any, what: Any) -> None:
    """x."""
    world.scheduler.running().context.output.line("*** " + world.text(what))


@TABLE.primitive("sleep")
def sleep(world: World, this: Any, d: float) -> None:
    """x."""
    world.scheduler.sleep(d)


