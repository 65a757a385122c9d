"""List: ordered members of any kind.

Source: manual, specs/list.  What runs often (``<<``, ``[]``, ``size``, ``+``) is raw; iteration goes over a snapshot.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import MOST_MEMBERS, List, String, too_long
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.channel import deprecated
from urbihw.kernel.stdlib.members import (
    Less,
    Ranked,
    callable_of,
    comparison,
    each,
    each_apart,
    each_tight,
    equal,
    index_in,
    less_members,
    repetitions,
    same_members,
)
from urbihw.kernel.stdlib.slices import MANY_CALLS, calls, give_way, in_slices, sort_in_slices

__breakable__ = True

TABLE = Table("List")
PROTOS = {"List": ("Container", "RangeIterable", "Orderable")}

SHORT = 1000
"""Characters of strings of which many are compared before anybody else has a turn."""


def _list(world: World, value: Any, index: int | None = None) -> list[Any]:
    if not isinstance(value, List):
        raise world.type_error(index, value, "List")
    return value.l


def _filled(members: list[Any]) -> list[Any]:
    if not members:
        raise errors.primitive("cannot be applied onto empty list")
    return members


# ---------------------------------------------------------------- conversions


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: list[Any]) -> str:
    """The members' ``asPrintable`` in brackets."""
    return "[" + ", ".join([world.printable(member) for member in in_slices(world, this)]) + "]"


@TABLE.primitive("asList")
def as_list(world: World, this: List) -> Any:
    """This list itself."""
    return this


@TABLE.primitive("asBool")
def as_bool(world: World, this: list[Any]) -> bool:
    """Whether there is a member."""
    return bool(this)


@TABLE.primitive("keys")
def keys(world: World, this: list[Any]) -> Any:
    """The valid indexes: 0 to size - 1."""
    return world.new_list([float(index) for index in in_slices(world, range(len(this)))])


@TABLE.primitive("join")
def join(world: World, this: List, sep: Any = None, prefix: str = "", suffix: str = "") -> Any:
    """The members' ``asString`` with a separator between them, a prefix before and a suffix behind."""
    return world.send(sep or world.string(""), "join", this, world.string(prefix), world.string(suffix))


# ---------------------------------------------------------------- asking


@TABLE.raw("size", least=0)
def size(world: World) -> Any:
    """The number of members."""

    def run(this: Any) -> float:
        return float(len(_list(world, this)))

    return run


@TABLE.primitive("empty")
def empty(world: World, this: list[Any]) -> bool:
    """Whether there is no member."""
    return not this


@TABLE.primitive("front", "head")
def front(world: World, this: list[Any]) -> Any:
    """The first member; an error if there is none."""
    return _filled(this)[0]


@TABLE.primitive("back")
def back(world: World, this: list[Any]) -> Any:
    """The last member; an error if there is none."""
    return _filled(this)[-1]


@TABLE.primitive("tail")
def tail(world: World, this: list[Any]) -> Any:
    """A new list without the first member; an error if there is none."""
    return world.new_list(_filled(this)[1:])


@TABLE.primitive("has")
def has(world: World, this: list[Any], value: Any) -> bool:
    """Whether a member equals the value."""
    return any(equal(world, member, value) for member in in_slices(world, this))


@TABLE.primitive("hasNot")
def has_not(world: World, this: list[Any], value: Any) -> bool:
    """Whether no member equals the value."""
    return not any(equal(world, member, value) for member in in_slices(world, this))


@TABLE.primitive("hasSame")
def has_same(world: World, this: list[Any], value: Any) -> bool:
    """Whether a member is the very value."""
    return any(member is value for member in in_slices(world, this))


@TABLE.primitive("subset")
def subset(world: World, this: list[Any], that: list[Any]) -> bool:
    """Whether every member is also one of the other list."""
    return all(has(world, that, member) for member in in_slices(world, this))


@TABLE.raw("[]", least=1)
def get_item(world: World) -> Any:
    """The member at an index; negative ones count from the end."""

    def run(this: Any, index: Any) -> Any:
        members = this.l if this.__class__ is List else _list(world, this)
        if index.__class__ is float and 0 <= index < len(members):
            place = int(index)
            if place == index:  # the usual case, without the checks
                return members[place]
        return members[index_in(len(members), index, world)]

    return run


@TABLE.primitive("range")
def range_(world: World, this: list[Any], begin: float, end: Any = None) -> Any:
    """The members from an index up to, not including, another; ``range(n)`` is ``range(0, n)``.  Negative indexes count
    from the end, and a range may run over it: ``[0, 1].range(-1, 1)`` is ``[1, 0]``."""
    if end is None or end is world.nil:
        begin, end = 0.0, begin
    low, high = _bound(world, this, begin), _bound(world, this, end)
    now = this[:]
    return world.new_list([now[index] for index in in_slices(world, range(low, high))])


def _bound(world: World, members: list[Any], value: Any) -> int:
    number = world.as_float(value, 2, "")
    if not -len(members) <= number <= len(members) or number != int(number):
        raise errors.primitive(f"invalid index: {world.text(number)}")
    return int(number)


# ---------------------------------------------------------------- order


@TABLE.primitive("sort")
def sort(world: World, this: List, function: Any = None) -> Any:
    """A new list of the members in order (that of ``<``, or of a function that tells whether a comes before b)."""
    members = list(this.l)
    kinds = {member.__class__ for member in in_slices(world, members)} if function is None else set()
    if kinds == {float}:
        sort_in_slices(world, members)
    elif kinds == {String} and all(len(member.s) <= SHORT for member in in_slices(world, members)):
        sort_in_slices(world, members, lambda member: member.s)
    else:
        order = _order(world, this, function)
        sort_in_slices(world, members, lambda member: Ranked(order, member))
    return world.new_list(members)


def _order(world: World, this: List, function: Any) -> Less:
    """The order meant by an optional comparison function; it gives way between comparisons of many members."""
    order = comparison(world, this, function)
    if len(this.l) <= MANY_CALLS:
        return order

    def patient(a: Any, b: Any) -> bool:
        give_way(world)
        return order(a, b)

    return patient


def _best(world: World, this: List, members: list[Any], function: Any, largest: bool) -> int:
    """The index of the best of the members of a list."""
    if not members:
        raise errors.primitive("list cannot be empty")
    order = _order(world, this, function)
    best = 0
    for index in in_slices(world, range(1, len(members))):
        old, new = members[best], members[index]
        if order(old, new) if largest else order(new, old):
            best = index
    return best


@TABLE.primitive("max")
def max_(world: World, this: List, function: Any = None) -> Any:
    """The largest member (by ``<``, or a function that tells whether a is less than b); the first of equals."""
    members = list(this.l)
    return members[_best(world, this, members, function, True)]


@TABLE.primitive("min")
def min_(world: World, this: List, function: Any = None) -> Any:
    """The smallest member (by ``<``, or a function that tells whether a is less than b); the first of equals."""
    members = list(this.l)
    return members[_best(world, this, members, function, False)]


@TABLE.primitive("argMax")
def arg_max(world: World, this: List, function: Any = None) -> int:
    """The index of the largest member; the first of equals."""
    return _best(world, this, list(this.l), function, True)


@TABLE.primitive("argMin")
def arg_min(world: World, this: List, function: Any = None) -> int:
    """The index of the smallest member; the first of equals."""
    return _best(world, this, list(this.l), function, False)


@TABLE.primitive("reverse")
def reverse(world: World, this: list[Any]) -> Any:
    """A new list of the members from last to first."""
    return world.new_list(this[::-1])


@TABLE.primitive("<")
def before(world: World, this: list[Any], other: list[Any]) -> bool:
    """Whether this list comes before the other in lexicographic order."""
    return less_members(world, this, other)


@TABLE.primitive("==")
def equals(world: World, this: list[Any], other: Any) -> bool:
    """Whether the other is a list of as many members, equal one by one."""
    return isinstance(other, List) and same_members(world, this, other.l)


@TABLE.primitive("!=")
def differs(world: World, this: list[Any], other: Any) -> bool:
    """Whether the other is no list of equal members."""
    return not (isinstance(other, List) and same_members(world, this, other.l))


# ---------------------------------------------------------------- calling functions on members


@TABLE.primitive("each")
def each_(world: World, this: List, function: Any) -> None:
    """Call a function on every member in turn, giving way to other jobs in between."""
    each(world, this, list(this.l), function)


@TABLE.primitive("each|")
def each_pipe(world: World, this: List, function: Any) -> None:
    """Call a function on every member in turn, at a stretch."""
    each_tight(world, this, list(this.l), function)


@TABLE.primitive("each&")
def each_and(world: World, this: List, function: Any) -> None:
    """Call a function on all members at the same time; over when all calls are."""
    each_apart(world, this, calls(world, this.l), function)


@TABLE.primitive("eachi")
def eachi(world: World, this: List, function: Any) -> None:
    """Call a function on every member and its index."""
    wanted = callable_of(world, function)
    for index, member in enumerate(calls(world, this.l)):
        world.invoke(wanted, this, (member, float(index)))


@TABLE.primitive("map")
def map_(world: World, this: List, function: Any) -> Any:
    """The list of what a function gives for each member."""
    wanted = callable_of(world, function)
    results = []
    for member in calls(world, this.l):
        result = world.invoke(wanted, this, (member,))
        if result is world.void:
            raise errors.unexpected_void()
        results.append(result)
    return world.new_list(results)


@TABLE.primitive("filter")
def filter_(world: World, this: List, function: Any) -> Any:
    """The list of the members for which a function gives something true."""
    wanted = callable_of(world, function)
    return world.new_list([member for member in calls(world, this.l) if world.invoke(wanted, this, (member,))])


@TABLE.primitive("all")
def all_(world: World, this: List, function: Any) -> bool:
    """Whether a function gives something true for every member; asks no further than the first that fails."""
    wanted = callable_of(world, function)
    return all(bool(world.invoke(wanted, this, (member,))) for member in calls(world, this.l))


@TABLE.primitive("any")
def any_(world: World, this: List, function: Any) -> bool:
    """Whether a function gives something true for some member; asks no further than the first that does."""
    wanted = callable_of(world, function)
    return any(bool(world.invoke(wanted, this, (member,))) for member in calls(world, this.l))


@TABLE.primitive("foldl")
def foldl(world: World, this: List, function: Any, value: Any) -> Any:
    """Combine a value with every member from left to right by a function of two arguments."""
    wanted = callable_of(world, function)
    for member in calls(world, this.l):
        value = world.invoke(wanted, this, (value, member))
        if value is world.void:
            raise errors.unexpected_void()
    return value


@TABLE.primitive("zip")
def zip_(world: World, this: List, function: Any, other: list[Any]) -> Any:
    """The list of what a function gives for each member and its partner in the other list."""
    wanted = callable_of(world, function)
    pairs = zip(calls(world, this.l), calls(world, other), strict=False)
    return world.new_list([world.invoke(wanted, this, pair) for pair in pairs])


@TABLE.primitive("matchAgainst")
def match_against(world: World, this: list[Any], handler: Any, pattern: Any) -> bool:
    """Whether a pattern (a List of the same size) matches, its members asked of the handler's ``matchPattern``."""
    if not isinstance(pattern, List) or len(pattern.l) != len(this):
        return False
    pairs = zip(in_slices(world, pattern.l), in_slices(world, this), strict=True)
    return all(bool(world.send(handler, "matchPattern", inner, member)) for inner, member in pairs)


# ---------------------------------------------------------------- changing


@TABLE.raw("<<", "insertBack", least=1)
def insert_back(world: World) -> Any:
    """Add a member at the end; gives this list."""

    def run(this: Any, value: Any) -> Any:
        (this.l if this.__class__ is List else _list(world, this)).append(value)
        if this.meta is not None:
            this.touch()
        return this

    return run


@TABLE.primitive("insertFront")
def insert_front(world: World, this: List, value: Any) -> Any:
    """Add a member at the beginning; gives this list."""
    this.l.insert(0, value)
    this.touch()
    return this


@TABLE.primitive("insert")
def insert(world: World, this: List, where: Any, value: Any) -> Any:
    """Add a member before the one at an index, which must be valid; gives this list."""
    this.l.insert(index_in(len(this.l), where, world), value)
    this.touch()
    return this


@TABLE.raw("[]=", least=2)
def set_item(world: World) -> Any:
    """Put a value at an index; gives the value."""

    def run(this: Any, index: Any, value: Any) -> Any:
        members = _list(world, this)
        members[index_in(len(members), index, world)] = value
        this.touch()
        return value

    return run


@TABLE.primitive("clear")
def clear(world: World, this: List) -> Any:
    """Remove all members; gives this list."""
    this.l.clear()
    this.touch()
    return this


@TABLE.primitive("remove")
def remove(world: World, this: List, value: Any) -> Any:
    """Remove all members equal to a value; gives this list."""
    gone = {id(member): member for member in in_slices(world, this.l) if equal(world, member, value)}
    _leave_out(this, gone)
    return this


@TABLE.primitive("removeById")
def remove_by_id(world: World, this: List, value: Any) -> Any:
    """Remove all members that are the very value; gives this list."""
    _leave_out(this, {id(value): value})
    return this


def _leave_out(this: List, gone: dict[int, Any]) -> None:
    """Remove members by their identity, in one go: others may have changed the list since these were chosen."""
    this.l[:] = [member for member in this.l if id(member) not in gone]
    this.touch()


@TABLE.primitive("removeFront")
def remove_front(world: World, this: List) -> Any:
    """Remove the first member and give it; an error if there is none."""
    value = _filled(this.l).pop(0)
    this.touch()
    return value


@TABLE.primitive("removeBack")
def remove_back(world: World, this: List) -> Any:
    """Remove the last member and give it; an error if there is none."""
    value = _filled(this.l).pop()
    this.touch()
    return value


def _bounded(members: list[Any], more: list[Any]) -> list[Any]:
    """The second of two lists that become one, which must not be too long."""
    if len(members) + len(more) > MOST_MEMBERS:
        raise too_long("members", MOST_MEMBERS)
    return more


@TABLE.primitive("+=")
def extend(world: World, this: List, that: list[Any]) -> Any:
    """Add the members of another list at the end of this one; gives this list."""
    this.l.extend(_bounded(this.l, list(that)))
    this.touch()
    return this


@TABLE.primitive("append")
def append(world: World, this: List, that: list[Any]) -> Any:
    """Deprecated: ``+=``."""
    deprecated(world, "list.append(that)", "list += that")
    this.l.extend(_bounded(this.l, list(that)))
    this.touch()
    return this


# ---------------------------------------------------------------- new lists by operators


@TABLE.raw("+", least=1)
def plus(world: World) -> Any:
    """A new list of the members of both."""

    def run(this: Any, other: Any) -> Any:
        members = _list(world, this)
        return world.new_list(members + _bounded(members, _list(world, other, 1)))

    return run


@TABLE.primitive("-")
def minus(world: World, this: list[Any], other: list[Any]) -> Any:
    """A new list of the members that equal none of the other list."""
    gone = list(other)
    kept = [m for m in in_slices(world, this) if not any(equal(world, m, value) for value in in_slices(world, gone))]
    return world.new_list(kept)


@TABLE.primitive("*")
def times(world: World, this: list[Any], number: Any) -> Any:
    """A new list of the same members over and over, a non-negative number of times."""
    return world.new_list(this * repetitions(world, number, len(this), MOST_MEMBERS, "members"))
