"""Functions shared by the containers: equality and order of members, calls with each member, indexes.

``each`` gives other jobs turns between calls like the ``;`` of a for-each; ``each_tight`` does not; ``each_apart`` runs
each call in a job of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Executable, ObjectCall
from urbihw.kernel.runtime.values import List, String, TextList, texts_in
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.group import Group
from urbihw.kernel.stdlib.slices import NestedWalk, in_slices
from urbihw.kernel.value import Value

Less = Callable[[Any, Any], bool]

__breakable__ = True
__calls__ = {"each": ("f",), "each_tight": ("f",)}

MAX_GENERATED_MEMBERS = 1e7
"""Maximum number of members that a primitive makes from a number."""


def equal(world: World, a: Value, b: Value) -> bool:
    """Whether ``a == b`` in urbiscript."""
    if a.__class__ is float and b.__class__ is float:
        return bool(a == b)
    if a.__class__ is String and b.__class__ is String and "==" not in a.slots:
        return bool(a.s == b.s)
    return bool(world.ops.equal(a, b))


def same_members(world: World, a: Sequence[Value], b: Sequence[Value]) -> bool:
    """Whether two sequences have the same size and equal members."""
    if len(a) != len(b):
        return False
    with NestedWalk(world) as walk:
        return all(equal(world, x, y) for x, y in zip(walk.members(a), in_slices(world, b), strict=True))


def less(world: World, a: Value, b: Value) -> bool:
    """Whether ``a < b``.  If a member of a built-in type cannot be compared with the other, the error names
    argument 2.
    """
    if a.__class__ is float:
        return bool(a < (b if b.__class__ is float else world.as_float(b, 2, "")))
    if a.__class__ is String and "<" not in a.slots:
        if not isinstance(b, String):
            raise world.type_error(2, b, "String")
        return bool(a.s < b.s)
    return bool(world.send(a, "<", b))


def comparison(world: World, this: Value, function: Value) -> Less:
    """The order defined by an optional comparison function."""
    if function is None:
        return partial(less, world)
    wanted = callable_of(world, function)
    return lambda a, b: bool(world.invoke(wanted, this, (a, b)))


def less_members(world: World, a: Sequence[Value], b: Sequence[Value]) -> bool:
    """Whether a sequence comes before another one in lexicographic order."""
    with NestedWalk(world) as walk:
        for x, y in zip(walk.members(a), in_slices(world, b), strict=False):
            if bool(world.send(x, "<", y)):
                return True
            if not equal(world, x, y):
                return False
    return len(a) < len(b)


class Ranked:
    """A member with an order defined by a function, for Python's sort."""

    __slots__ = ("less", "value")

    def __init__(self, order: Less, value: Value) -> None:
        self.less = order
        self.value = value

    def __lt__(self, other: Ranked) -> bool:
        return self.less(self.value, other.value)


def callable_of(world: World, value: Value, index: int = 1) -> Executable:
    """The function to call for an argument: the argument itself, or the operator ``()`` of an object that has one
    (manual, release notes of 2.0 beta 3).  Raises the type error for anything else.
    """
    if isinstance(value, Executable):
        return value
    if world.peek_obj(value).find("()") is None:
        raise world.type_error(index, value, "Code")
    return ObjectCall(world, value)


def each(world: World, this: Value, members: Iterable[Value], function: Value) -> None:
    """Call a function with each member in turn, with turns for other jobs in between."""
    wanted = callable_of(world, function)
    scheduler = world.scheduler
    first = True
    for member in members:
        if not first and scheduler.ready:
            scheduler.yield_()
        first = False
        world.invoke(wanted, this, (member,))


def each_tight(world: World, this: Value, members: Iterable[Value], function: Value) -> None:
    """Call a function with each member in turn."""
    wanted = callable_of(world, function)
    for member in members:
        world.invoke(wanted, this, (member,))


def each_apart(world: World, this: Value, members: Iterable[Value], function: Value) -> None:
    """Call a function with all members in parallel; wait until all calls have ended."""
    wanted = callable_of(world, function)
    with Group(world.scheduler) as group:
        for member in members:
            group.launch(partial(world.invoke, wanted, this, (member,)), "each&")


def index_in(size: int, value: Value, world: World, negative: bool = True) -> int:
    """A valid index into ``size`` members; negative indexes count from the end.  Raises ``invalid index: N``."""
    number = world.as_float(value, 1, "") if value.__class__ is not float else value
    low = -size if negative else 0
    if not low <= number < size or number != int(number):
        raise errors.primitive(f"invalid index: {world.text(value)}")
    index = int(number)
    return index + size if index < 0 else index


def count(world: World, value: Value, index: int = 1) -> int:
    """Check that argument number ``index`` is a non-negative integer, and return it."""
    number = world.as_float(value, index, "") if value.__class__ is not float else value
    if not 0 <= number < 2**63 or number != int(number):
        raise errors.bad_number("BadInteger", f"expected non-negative integer, got {world.text(value)}", value)
    return int(number)


def repetitions(world: World, value: Value, size: int, most: int, what: str) -> int:
    """The number of repetitions of something of this size.  Raises an error if the result would be larger than
    ``most``.
    """
    number = count(world, value)
    if number * size > most:
        wanted = f"expected a result of at most {most} {what}, got {world.text(value)} times {size}"
        raise errors.bad_number("BadNumber", wanted, value)
    return number


def members_of(world: World, value: Value) -> Iterable[Any]:
    """The members of an argument, as ``each`` enumerates them.  Raises an error for a number that is too large."""
    if value.__class__ is float and value > MAX_GENERATED_MEMBERS:
        message = f"expected at most {MAX_GENERATED_MEMBERS:.0f} members, got {world.text(value)}"
        raise errors.bad_number("BadNumber", message, value)
    return world.iterate(value)


def texts_of(world: World, value: Value) -> list[str]:
    """The ``asString`` of the members of an argument."""
    if value.__class__ is TextList and world.recorder.active is None and "each" not in value.slots:
        return texts_in(value)
    return [world.text(member) for member in in_slices(world, [*members_of(world, value)])]


def strings_of(world: World, value: Value, index: int) -> list[str]:
    """The strings of an argument that is a String (or a literal text) or a List of Strings."""
    if value.__class__ is str:
        return [value]
    if isinstance(value, String):
        return [value.s]
    if not isinstance(value, List):
        raise world.type_error(index, value, "String")
    found = []
    for member in in_slices(world, value.l):
        if not isinstance(member, String):
            raise world.type_error(index, member, "String")
        found.append(member.s)
    return found
