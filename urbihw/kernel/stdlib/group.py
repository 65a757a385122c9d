"""Group: several objects that receive messages together.

Source: manual, specs/group.  Calls go to all members in parallel; the results are in the order of the members.  A Group
that is assigned to a slot of a group of the same size, or is an operand with one, is distributed member by member:
``robot.wheel.val = robot.wheel.val + d`` moves each wheel relative to its own position (manual, specs/naming-standard).
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
from urbihw.kernel.value import Value

TABLE = Table("Group")
ARITHMETIC = frozenset(("+", "-", "*", "/", "%", "**"))
"""Operators that work member by member between two groups."""
ORDER = ("<", "<=", ">", ">=")
"""Comparisons that work member by member; Object has its own, which would get the whole group as an operand."""
MATH = (
    "abs", "acos", "asin", "atan", "ceil", "cos", "exp", "floor", "log", "round", "sign", "sin", "sqr", "sqrt", "tan",
    "trunc",
)  # fmt: skip
"""Functions of Float without arguments; Object has functions of the same names with one argument."""


class GroupObject(Obj):
    """An urbiscript Group, with its members."""

    __slots__ = ("members",)
    assigns_to_members = True

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.members: list[Any] = []

    def clone(self) -> GroupObject:
        """A group with the same members."""
        made = GroupObject(self.world, [self])
        made.members = list(self.members)
        return made

    def bounce(self, action: Callable[[Any], Any]) -> Any:
        """Run an action for all members in parallel; returns the Group of the results, void if all are void."""
        return self.distribute(None, lambda member, share: action(member))

    def distribute(self, value: Value, action: Callable[[Any, Any], Any]) -> Value:
        """Call ``action(member, share)`` for all members in parallel; returns the Group of the results, or void."""
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

    def after_number(self, left: Value, operator: str) -> Any:
        """``left operator this`` with a number as the left operand: the Group of the results for each member."""
        return self.bounce(lambda member: self.world.send(left, operator, member))

    def gathered(self, results: list[Value]) -> Any:
        """The Group of the results that are not void; void if there are none."""
        made = GroupObject(self.world, [self.world.classes["Group"]])
        made.members = [result for result in results if result is not self.world.void]
        return made if made.members else self.world.void


CLASSES = {"Group": GroupObject}


@TABLE.primitive("init")
def init(world: World, this: GroupObject, *members: Value) -> None:
    """Make a group of these members."""
    this.members = [*members]


@TABLE.primitive("add", "<<")
def add(world: World, this: GroupObject, *members: Value) -> Value:
    """Add members; returns this group."""
    this.members += members
    return this


@TABLE.primitive("remove")
def remove(world: World, this: GroupObject, *members: Value) -> Value:
    """Remove the members equal to any of these; returns this group."""
    this.members = [m for m in this.members if not any(equal(world, m, gone) for gone in members)]
    return this


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: GroupObject) -> str:
    """``Group`` and the ``asPrintable`` of the members, in brackets."""
    return "Group [" + ", ".join([world.printable(member) for member in this.members]) + "]"


@TABLE.primitive("each", "each|")
def each(world: World, this: GroupObject, function: Value) -> Value:
    """Call a function with each member in turn; returns the Group of the results."""
    wanted = callable_of(world, function)
    return this.gathered([world.invoke(wanted, this, (member,)) for member in list(this.members)])


@TABLE.primitive("each&")
def each_and(world: World, this: GroupObject, function: Value) -> Value:
    """Call a function with all members in parallel; returns the Group of the results."""
    wanted = callable_of(world, function)
    return this.bounce(lambda member: world.invoke(wanted, this, (member,)))


@TABLE.lazy("fallback", least=0, most=-1)
def fallback(world: World, message: Value) -> Value:
    """Send a message that Group does not define to all members; returns the Group of the results, void if all are
    void.
    """
    this, name = message.target, message.message
    if not isinstance(this, GroupObject):
        raise world.type_error(None, this, "Group")
    args = [argument.force() for argument in message.args]
    if name in ARITHMETIC and len(args) == 1:
        return this.distribute(args[0], lambda member, share: world.send(member, name, share))
    return this.bounce(lambda member: world.send(member, name, *args))


def _compare(operator: str) -> Callable[[World, GroupObject, Value], Any]:
    def compare(world: World, this: GroupObject, other: Value) -> Any:
        """The Group of the Booleans of the comparison, member by member if the operand is a Group of the same size."""
        return this.distribute(other, lambda member, share: world.send(member, operator, share))

    return compare


def _apply(name: str) -> Callable[[World, GroupObject], Any]:
    def apply(world: World, this: GroupObject) -> Any:
        """The Group of the results of this function for each member."""
        return this.bounce(lambda member: world.send(member, name))

    return apply


for _operator in ORDER:
    TABLE.primitive(_operator)(_compare(_operator))
for _name in MATH:
    TABLE.primitive(_name)(_apply(_name))


@TABLE.primitive("load")
def load(world: World, this: GroupObject, *args: Value) -> Value:
    """The Group of ``load`` of each member, for motors their power; ``load`` of Object would look for a file."""
    return this.bounce(lambda member: world.send(member, "load", *args))


@TABLE.primitive("updateSlot")
def update_slot(world: World, this: GroupObject, name: str, value: Value) -> Value:
    """Assign a slot of all members; returns the Group of the values."""
    return this.distribute(value, lambda member, share: world.update_slot(member, name, share))


@TABLE.primitive("getProperty")
def get_property(world: World, this: GroupObject, slot: Value, name: Value) -> Value:
    """The Group of the values of a property of a slot, for all members."""
    return this.bounce(lambda member: world.send(member, "getProperty", slot, name))


@TABLE.primitive("hasProperty")
def has_property(world: World, this: GroupObject, slot: Value, name: Value) -> Value:
    """The Group of Booleans that tell whether a slot of each member has a property."""
    return this.bounce(lambda member: world.send(member, "hasProperty", slot, name))


@TABLE.primitive("setProperty")
def set_property(world: World, this: GroupObject, slot: Value, name: Value, value: Value) -> Value:
    """Set a property of a slot of all members; returns the Group of the values."""
    return this.bounce(lambda member: world.send(member, "setProperty", slot, name, value))
