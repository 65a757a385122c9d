"""What the containers share: equality and order of members, calling functions on members, indexes.

``each`` yields between calls like the ``;`` of a for-each, ``each_tight`` does not, ``each_apart`` gives every member
a job of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.values import List, String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.group import Group
from urbihw.kernel.stdlib.slices import in_slices

Less = Callable[[Any, Any], bool]

__breakable__ = True

MANY = 1e7
"""How many members a built-in function may be asked to make of a number."""


def equal(world: World, a: Any, b: Any) -> bool:
    """Whether ``a == b`` as urbiscript has it."""
    if a.__class__ is float and b.__class__ is float:
        return bool(a == b)
    if a.__class__ is String and b.__class__ is String and "==" not in a.slots:
        return bool(a.s == b.s)
    return bool(world.ops.equal(a, b))


def same_members(world: World, a: Sequence[Any], b: Sequence[Any]) -> bool:
    """Whether two sequences are equal member by member."""
    if len(a) != len(b):
        return False
    return all(equal(world, x, y) for x, y in zip(in_slices(world, a), in_slices(world, b), strict=True))


def less(world: World, a: Any, b: Any) -> bool:
    """Whether ``a < b``; a member that cannot be compared with another of a built-in type is argument 2."""
    if a.__class__ is float:
        return bool(a < (b if b.__class__ is float else world.as_float(b, 2, "")))
    if a.__class__ is String and "<" not in a.slots:
        if not isinstance(b, String):
            raise world.type_error(2, b, "String")
        return bool(a.s < b.s)
    return bool(world.send(a, "<", b))


def comparison(world: World, this: Any, function: Any) -> Less:
    """The order meant by an optional comparison function."""
    if function is None:
        return partial(less, world)
    wanted = callable_of(world, function)
    return lambda a, b: bool(world.invoke(wanted, this, (a, b)))


def less_members(world: World, a: Sequence[Any], b: Sequence[Any]) -> bool:
    """Whether a sequence comes before another in lexicographic order."""
    for x, y in zip(in_slices(world, a), in_slices(world, b), strict=False):
        if bool(world.send(x, "<", y)):
            return True
        if not equal(world, x, y):
            return False
    return len(a) < len(b)


class Ranked:
    """A member under an order given by a function, for Python's sort."""

    __slots__ = ("less", "value")

    def __init__(self, order: Less, value: Any) -> None:
        self.less = order
        self.value = value

    def __lt__(self, other: Ranked) -> bool:
        return self.less(self.value, other.value)


def callable_of(world: World, value: Any, index: int = 1) -> Executable:
    """An argument that must be a function."""
    if not isinstance(value, Executable):
        raise world.type_error(index, value, "Code")
    return value


def each(world: World, this: Any, members: Iterable[Any], function: Any) -> None:
    """Call a function on members in turn, giving way to others in between."""
    wanted = callable_of(world, function)
    scheduler = world.scheduler
    first = True
    for member in members:
        if not first and scheduler.ready:
            scheduler.yield_()
        first = False
        world.invoke(wanted, this, (member,))


def each_tight(world: World, this: Any, members: Iterable[Any], function: Any) -> None:
    """Call a function on members in turn."""
    wanted = callable_of(world, function)
    for member in members:
        world.invoke(wanted, this, (member,))


def each_apart(world: World, this: Any, members: Iterable[Any], function: Any) -> None:
    """Call a function on all members at the same time; wait until all calls are over."""
    wanted = callable_of(world, function)
    with Group(world.scheduler) as group:
        for member in members:
            group.launch(partial(world.invoke, wanted, this, (member,)), "each&")


def index_in(size: int, value: Any, world: World, negative: bool = True) -> int:
    """A valid index into ``size`` members; negative ones count from the end.  Raises ``invalid index: N``."""
    number = world.as_float(value, 1, "") if value.__class__ is not float else value
    low = -size if negative else 0
    if not low <= number < size or number != int(number):
        raise errors.primitive(f"invalid index: {world.text(value)}")
    index = int(number)
    return index + size if index < 0 else index


def count(world: World, value: Any, index: int = 1) -> int:
    """The argument number ``index``, which must be a non-negative integer."""
    number = world.as_float(value, index, "") if value.__class__ is not float else value
    if not 0 <= number < 2**63 or number != int(number):
        raise errors.bad_number("NegativeNumber", f"expected non-negative integer, got {world.text(value)}")
    return int(number)


def repetitions(world: World, value: Any, size: int, most: int, what: str) -> int:
    """How often something of this size is to be repeated; raises if it would be more than ``most`` in all."""
    number = count(world, value)
    if number * size > most:
        wanted = f"expected a result of at most {most} {what}, got {world.text(value)} times {size}"
        raise errors.bad_number("BadNumber", wanted)
    return number


def members_of(world: World, value: Any) -> Iterable[Any]:
    """What ``each`` gives of an argument; not of a number so large that nobody means to wait for its end."""
    if value.__class__ is float and value > MANY:
        raise errors.bad_number("BadNumber", f"expected at most {MANY:.0f} members, got {world.text(value)}")
    return world.iterate(value)


def strings_of(world: World, value: Any, index: int) -> list[str]:
    """An argument that is a String, or a List of them."""
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
