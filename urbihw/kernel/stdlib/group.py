"""Group: messages to several objects as if they were one.

Source: manual, specs/group.  Calls reach all members at the same time; the results come in the order of the members.
A Group that is assigned to a slot of as many members, or an operand of theirs, is shared out: so
``robot.wheel.val = robot.wheel.val + d`` moves each wheel from where it is (manual, specs/naming-standard).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.group import Group as Jobs
from urbihw.kernel.stdlib.members import callable_of, equal

TABLE = Table("Group")
ARITHMETIC = frozenset(("+", "-", "*", "/", "%", "**"))
"""Operators between two groups that work member by member."""


class GroupObject(Obj):
    """An urbiscript Group."""

    __slots__ = ("members",)
    bounces = True

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.members: list[Any] = []

    def clone(self) -> GroupObject:
        """A group of the same members."""
        made = GroupObject(self.world, [self])
        made.members = list(self.members)
        return made

    def bounce(self, action: Callable[[Any], Any]) -> Any:
        """Do something with all members at the same time; the Group of the results, void if they are all void."""
        return self.distribute(None, lambda member, share: action(member))

    def distribute(self, value: Any, action: Callable[[Any, Any], Any]) -> Any:
        """Call ``action(member, share)`` for all members at the same time; the Group of the results, or void."""
        members = list(self.members)
        split = isinstance(value, GroupObject) and len(value.members) == len(members)
        shares = list(value.members) if split else [value] * len(members)
        if len(members) < 2:
            return self.gathered(list(map(action, members, shares)))
        results: list[Any] = [self.world.void] * len(members)

        def run(index: int) -> None:
            results[index] = action(members[index], shares[index])

        with Jobs(self.world.scheduler) as jobs:
            for index in range(len(members)):
                jobs.launch(partial(run, index), "group")
        return self.gathered(results)

    def gathered(self, results: list[Any]) -> Any:
        """The Group of results that are not void, or void."""
        made = GroupObject(self.world, [self.world.classes["Group"]])
        made.members = [result for result in results if result is not self.world.void]
        return made if made.members else self.world.void


CLASSES = {"Group": GroupObject}


@TABLE.primitive("init")
def init(world: World, this: GroupObject, *members: Any) -> None:
    """A group of these members."""
    this.members = [*members]


@TABLE.primitive("add", "<<")
def add(world: World, this: GroupObject, *members: Any) -> Any:
    """Add members; gives this group."""
    this.members += members
    return this


@TABLE.primitive("remove")
def remove(world: World, this: GroupObject, *members: Any) -> Any:
    """Remove members equal to any of these; gives this group."""
    this.members = [m for m in this.members if not any(equal(world, m, gone) for gone in members)]
    return this


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: GroupObject) -> str:
    """``Group`` and the members' ``asPrintable`` in brackets."""
    return "Group [" + ", ".join([world.printable(member) for member in this.members]) + "]"


@TABLE.primitive("each", "each|")
def each(world: World, this: GroupObject, function: Any) -> Any:
    """Call a function on every member in turn; the Group of the results."""
    wanted = callable_of(world, function)
    return this.gathered([world.invoke(wanted, this, (member,)) for member in list(this.members)])


@TABLE.primitive("each&")
def each_and(world: World, this: GroupObject, function: Any) -> Any:
    """Call a function on all members at the same time; the Group of the results."""
    wanted = callable_of(world, function)
    return this.bounce(lambda member: world.invoke(wanted, this, (member,)))


@TABLE.lazy("fallback", least=0, most=-1)
def fallback(world: World, message: Any) -> Any:
    """Send a message that a group does not understand to all members; the Group of the results, void if they are all
    void."""
    this, name = message.target, message.message
    if not isinstance(this, GroupObject):
        raise world.type_error(None, this, "Group")
    args = [argument.force() for argument in message.args]
    if name in ARITHMETIC and len(args) == 1:
        return this.distribute(args[0], lambda member, share: world.send(member, name, share))
    return this.bounce(lambda member: world.send(member, name, *args))


@TABLE.primitive("updateSlot")
def update_slot(world: World, this: GroupObject, name: str, value: Any) -> Any:
    """Assign a slot of all members; the Group of the values."""
    return this.distribute(value, lambda member, share: world.update_slot(member, name, share))


@TABLE.primitive("getProperty")
def get_property(world: World, this: GroupObject, slot: Any, name: Any) -> Any:
    """The Group of a property of a slot of all members."""
    return this.bounce(lambda member: world.send(member, "getProperty", slot, name))


@TABLE.primitive("hasProperty")
def has_property(world: World, this: GroupObject, slot: Any, name: Any) -> Any:
    """The Group of whether a slot of each member has a property."""
    return this.bounce(lambda member: world.send(member, "hasProperty", slot, name))


@TABLE.primitive("setProperty")
def set_property(world: World, this: GroupObject, slot: Any, name: Any, value: Any) -> Any:
    """Set a property of a slot of all members; the Group of the values."""
    return this.bounce(lambda member: world.send(member, "setProperty", slot, name, value))
