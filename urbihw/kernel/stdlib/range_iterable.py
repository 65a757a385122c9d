"""RangeIterable: iteration over the members of ``asList``."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import List
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import members
from urbihw.kernel.stdlib.slices import calls
from urbihw.kernel.value import Value

__breakable__ = True
__calls__ = {"all_": ("f", "each|"), "any_": ("f", "each|")}

TABLE = Table("RangeIterable")


def _members(world: World, this: Value) -> list[Any]:
    found = world.send(this, "asList")
    if not isinstance(found, List):
        raise world.type_error(None, found, "List", "asList")
    return [*found.l]


@TABLE.primitive("all")
def all_(world: World, this: Value, function: Value) -> bool:
    """Whether the function returns a true value for all members; stops at the first member for which it does not."""
    return all(world.invoke(function, this, (member,)) for member in calls(world, _members(world, this)))


@TABLE.primitive("any")
def any_(world: World, this: Value, function: Value) -> bool:
    """Whether the function returns a true value for some member; stops at the first such member."""
    return any(world.invoke(function, this, (member,)) for member in calls(world, _members(world, this)))


@TABLE.primitive("each")
def each(world: World, this: Value, function: Value) -> None:
    """Call the function with each member in turn; other jobs may run in between."""
    members.each(world, this, _members(world, this), function)


@TABLE.primitive("each|")
def each_pipe(world: World, this: Value, function: Value) -> None:
    """Call the function with each member in turn, without a turn for other jobs."""
    members.each_tight(world, this, _members(world, this), function)


@TABLE.primitive("each&")
def each_and(world: World, this: Value, function: Value) -> None:
    """Call the function with all members in parallel, and wait until all calls have ended."""
    members.each_apart(world, this, _members(world, this), function)
