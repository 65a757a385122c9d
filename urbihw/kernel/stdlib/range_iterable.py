"""RangeIterable: loops and questions over what ``asList`` gives."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import List
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.group import Group

TABLE = Table("RangeIterable")


def _members(world: World, this: Any) -> list[Any]:
    members = world.send(this, "asList")
    if not isinstance(members, List):
        raise world.type_error(None, members, "List", "asList")
    return [*members.l]


@TABLE.primitive("all")
def all_(world: World, this: Any, function: Any) -> bool:
    """Whether the function is true of all members; stops at the first of which it is not."""
    return all(world.invoke(function, this, (member,)) for member in _members(world, this))


@TABLE.primitive("any")
def any_(world: World, this: Any, function: Any) -> bool:
    """Whether the function is true of a member; stops at the first one."""
    return any(world.invoke(function, this, (member,)) for member in _members(world, this))


@TABLE.primitive("each")
def each(world: World, this: Any, function: Any) -> None:
    """Call the function on each member in turn; other jobs may run in between."""
    each_of(world, this, _members(world, this), function)


@TABLE.primitive("each|")
def each_pipe(world: World, this: Any, function: Any) -> None:
    """Call the function on each member in turn, without a pause."""
    for member in _members(world, this):
        world.invoke(function, this, (member,))


@TABLE.primitive("each&")
def each_and(world: World, this: Any, function: Any) -> None:
    """Call the function on all members at once, and wait until all calls are over."""
    each_at_once(world, this, _members(world, this), function)


def each_of(world: World, this: Any, members: list[Any], function: Any) -> None:
    """``each`` over these members."""
    scheduler = world.scheduler
    for index, member in enumerate(members):
        if index and scheduler.ready:
            scheduler.yield_()
        world.invoke(function, this, (member,))


def each_at_once(world: World, this: Any, members: list[Any], function: Any) -> None:
    """``each&`` over these members."""
    with Group(world.scheduler) as group:
        for member in members:
            group.launch(lambda member=member: world.invoke(function, this, (member,)))  # type: ignore[misc]
