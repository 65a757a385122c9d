"""RangeIterable: loops and questions over what ``asList`` gives."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import List
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import members
from urbihw.kernel.stdlib.slices import calls

__breakable__ = True

TABLE = Table("RangeIterable")


def _members(world: World, this: Any) -> list[Any]:
    found = world.send(this, "asList")
    if not isinstance(found, List):
        raise world.type_error(None, found, "List", "asList")
    return [*found.l]


@TABLE.primitive("all")
def all_(world: World, this: Any, function: Any) -> bool:
    """Whether the function is true of all members; stops at the first of which it is not."""
    return all(world.invoke(function, this, (member,)) for member in calls(world, _members(world, this)))


@TABLE.primitive("any")
def any_(world: World, this: Any, function: Any) -> bool:
    """Whether the function is true of a member; stops at the first one."""
    return any(world.invoke(function, this, (member,)) for member in calls(world, _members(world, this)))


@TABLE.primitive("each")
def each(world: World, this: Any, function: Any) -> None:
    """Call the function on each member in turn; other jobs may run in between."""
    members.each(world, this, _members(world, this), function)


@TABLE.primitive("each|")
def each_pipe(world: World, this: Any, function: Any) -> None:
    """Call the function on each member in turn, without a pause."""
    members.each_tight(world, this, _members(world, this), function)


@TABLE.primitive("each&")
def each_and(world: World, this: Any, function: Any) -> None:
    """Call the function on all members at once, and wait until all calls are over."""
    members.each_apart(world, this, _members(world, this), function)
