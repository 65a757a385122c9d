"""List: ordered members of any kind.

Source: manual, specs/list.  Frequent operations (``<<``, ``[]``, ``size``, ``+``) are raw primitives; iteration uses a
snapshot of the members.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.primitive import CheckedPrimitive, Table
from urbihw.kernel.runtime.values import MAX_LIST_LENGTH, List, String, too_long
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import string
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
from urbihw.kernel.stdlib.slices import (
    MAX_ATOMIC_CALLS,
    MAX_ATOMIC_MEMBERS,
    NestedWalk,
    calls,
    give_way,
    in_slices,
    sort_in_slices,
)
from urbihw.kernel.value import Value, ValueOrText

__breakable__ = True
__calls__ = dict.fromkeys(("eachi", "map_", "filter_", "all_", "any_", "foldl", "zip_"), ("f", "each|"))

TABLE = Table("List")
PROTOS = {"List": ("Container", "RangeIterable", "Orderable")}

MAX_ATOMIC_TEXT_LENGTH = 1000
"""Maximum length, in characters, of strings that are compared in large numbers without a turn for other jobs."""


def _list(world: World, value: Value, index: int | None = None) -> list[Any]:
    if not isinstance(value, List):
        raise world.type_error(index, value, "List")
    return value.l


def _filled(members: list[Value]) -> list[Any]:
    if not members:
        raise errors.primitive("cannot be applied onto empty list")
    return members


# ---------------------------------------------------------------- conversions


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: List) -> str:
    """The members' ``asPrintable`` in brackets; ``[...]`` for a list within itself."""
    with NestedWalk(world, this) as walk:
        if walk.inside:
            return "[...]"
        return "[" + ", ".join([world.printable(member) for member in walk.members(this.l)]) + "]"


@TABLE.primitive("asList")
def as_list(world: World, this: List) -> Value:
    """Returns this list itself."""
    return this


@TABLE.primitive("asBool")
def as_bool(world: World, this: list[Value]) -> bool:
    """Whether the list is not empty."""
    return bool(this)


@TABLE.primitive("keys")
def keys(world: World, this: list[Value]) -> Value:
    """The valid indexes: 0 to size - 1."""
    return world.new_list([float(index) for index in in_slices(world, range(len(this)))])


@TABLE.primitive("join")
def join(world: World, this: List, sep: ValueOrText | None = None, prefix: str = "", suffix: str = "") -> Value:
    """Join the members' ``asString`` with a separator between them, a prefix before and a suffix after."""
    between: Any = "" if sep is None else sep
    is_text = between.__class__ is str
    found = world.ops.method(world.string_proto if is_text else between, "join")
    if found.__class__ is CheckedPrimitive and found.source is string.join and (is_text or isinstance(between, String)):
        return world.string(string.joined(world, between if is_text else between.s, this, prefix, suffix))
    if is_text:
        between = world.string(between)
    return world.invoke(found, between, (this, world.string(prefix), world.string(suffix)), "join")


# ---------------------------------------------------------------- asking


@TABLE.raw("size", least=0)
def size(world: World) -> Any:
    """The number of members."""

    def run(this: Value) -> float:
        return float(len(_list(world, this)))

    return run


@TABLE.primitive("empty")
def empty(world: World, this: list[Value]) -> bool:
    """Whether the list is empty."""
    return not this


@TABLE.primitive("front", "head")
def front(world: World, this: list[Value]) -> Value:
    """The first member.  Raises an error if the list is empty."""
    return _filled(this)[0]


@TABLE.primitive("back")
def back(world: World, this: list[Value]) -> Value:
    """The last member.  Raises an error if the list is empty."""
    return _filled(this)[-1]


@TABLE.primitive("tail")
def tail(world: World, this: list[Value]) -> Value:
    """A new list without the first member.  Raises an error if the list is empty."""
    return world.new_list(_filled(this)[1:])


@TABLE.primitive("has")
def has(world: World, this: list[Value], value: Value) -> bool:
    """Whether a member is equal to the value."""
    return any(equal(world, member, value) for member in in_slices(world, this))


@TABLE.primitive("hasNot")
def has_not(world: World, this: list[Value], value: Value) -> bool:
    """Whether no member is equal to the value."""
    return not any(equal(world, member, value) for member in in_slices(world, this))


@TABLE.primitive("hasSame")
def has_same(world: World, this: list[Value], value: Value) -> bool:
    """Whether the value itself is a member, compared by identity."""
    return any(member is value for member in in_slices(world, this))


@TABLE.primitive("subset")
def subset(world: World, this: list[Value], that: list[Value]) -> bool:
    """Whether every member is also a member of the other list."""
    return all(has(world, that, member) for member in in_slices(world, this))


@TABLE.raw("[]", least=1)
def get_item(world: World) -> Any:
    """The member at an index; negative indexes count from the end."""

    def run(this: Value, index: Value) -> Value:
        members = this.l if this.__class__ is List else _list(world, this)
        if index.__class__ is float and 0 <= index < len(members):
            place = int(index)
            if place == index:  # the usual case, without the checks
                return members[place]
        return members[index_in(len(members), index, world)]

    return run


@TABLE.primitive("range")
def range_(world: World, this: list[Value], begin: float, end: Value = None) -> Value:
    """The members from index ``begin`` up to, but not including, ``end``; ``range(n)`` is ``range(0, n)``.  Negative
    indexes count from the end, and a range may cross the end: ``[0, 1].range(-1, 1)`` is ``[1, 0]``."""
    if end is None or end is world.nil:
        begin, end = 0.0, begin
    low, high = _bound(world, this, begin), _bound(world, this, end)
    now = this[:]
    return world.new_list([now[index] for index in in_slices(world, range(low, high))])


def _bound(world: World, members: list[Value], value: Value) -> int:
    number = world.as_float(value, 2, "")
    if not -len(members) <= number <= len(members) or number != int(number):
        raise errors.primitive(f"invalid index: {world.text(number)}")
    return int(number)


# ---------------------------------------------------------------- order


@TABLE.primitive("sort")
def sort(world: World, this: List, function: Value = None) -> Value:
    """A new list with the members in ascending order, compared by ``<`` or by a function that tells whether a is less
    than b.
    """
    members = list(this.l)
    if len(members) > MAX_ATOMIC_MEMBERS:
        give_way(world)  # a copy of a million members takes 15 ms, and the look at their kinds needs another one
    kinds = {member.__class__ for member in in_slices(world, members)} if function is None else set()
    if kinds == {float}:
        members = sort_in_slices(world, members)
    elif kinds == {String} and all(len(member.s) <= MAX_ATOMIC_TEXT_LENGTH for member in in_slices(world, members)):
        members = sort_in_slices(world, members, lambda member: member.s)
    else:
        order = _order(world, this, function)
        members = sort_in_slices(world, members, lambda member: Ranked(order, member))
    return world.new_list(members)


def _order(world: World, this: List, function: Value) -> Less:
    """The order defined by an optional comparison function; it gives other jobs turns while many members are
    compared.
    """
    order = comparison(world, this, function)
    if len(this.l) <= MAX_ATOMIC_CALLS:
        return order

    def patient(a: Value, b: Value) -> bool:
        give_way(world)
        return order(a, b)

    return patient


def _best(world: World, this: List, members: list[Value], function: Value, largest: bool) -> int:
    """The index of the extreme member of a list in the given order."""
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
def max_(world: World, this: List, function: Value = None) -> Value:
    """The largest member, compared by ``<`` or by a function that tells whether a is less than b; the first of equal
    ones.
    """
    members = list(this.l)
    return members[_best(world, this, members, function, True)]


@TABLE.primitive("min")
def min_(world: World, this: List, function: Value = None) -> Value:
    """The smallest member, compared by ``<`` or by a function that tells whether a is less than b; the first of equal
    ones.
    """
    members = list(this.l)
    return members[_best(world, this, members, function, False)]


@TABLE.primitive("argMax")
def arg_max(world: World, this: List, function: Value = None) -> int:
    """The index of the largest member; the first of equal ones."""
    return _best(world, this, list(this.l), function, True)


@TABLE.primitive("argMin")
def arg_min(world: World, this: List, function: Value = None) -> int:
    """The index of the smallest member; the first of equal ones."""
    return _best(world, this, list(this.l), function, False)


@TABLE.primitive("reverse")
def reverse(world: World, this: list[Value]) -> Value:
    """A new list with the members in reverse order."""
    return world.new_list(this[::-1])


@TABLE.primitive("<")
def before(world: World, this: list[Value], other: list[Value]) -> bool:
    """Whether this list comes before the other in lexicographic order."""
    return less_members(world, this, other)


@TABLE.primitive("==")
def equals(world: World, this: list[Value], other: Value) -> bool:
    """Whether the other value is a list of the same size with equal members."""
    return isinstance(other, List) and same_members(world, this, other.l)


@TABLE.primitive("!=")
def differs(world: World, this: list[Value], other: Value) -> bool:
    """Whether the other value is not a list of the same size with equal members."""
    return not (isinstance(other, List) and same_members(world, this, other.l))


# ---------------------------------------------------------------- calling functions on members


@TABLE.primitive("each")
def each_(world: World, this: List, function: Value) -> None:
    """Call a function with every member in turn; other jobs may run in between."""
    each(world, this, list(this.l), function)


@TABLE.primitive("each|")
def each_pipe(world: World, this: List, function: Value) -> None:
    """Call a function with every member in turn, without a turn for other jobs."""
    each_tight(world, this, list(this.l), function)


@TABLE.primitive("each&")
def each_and(world: World, this: List, function: Value) -> None:
    """Call a function with all members in parallel, and wait until all calls have ended."""
    each_apart(world, this, calls(world, this.l), function)


@TABLE.primitive("eachi")
def eachi(world: World, this: List, function: Value) -> None:
    """Call a function with every member and its index."""
    wanted = callable_of(world, function)
    for index, member in enumerate(calls(world, this.l)):
        world.invoke(wanted, this, (member, float(index)))


@TABLE.primitive("map")
def map_(world: World, this: List, function: Value) -> Value:
    """The list of a function's results for each member."""
    wanted = callable_of(world, function)
    results = []
    for member in calls(world, this.l):
        result = world.invoke(wanted, this, (member,))
        if result is world.void:
            raise errors.unexpected_void()
        results.append(result)
    return world.new_list(results)


@TABLE.primitive("filter")
def filter_(world: World, this: List, function: Value) -> Value:
    """The list of the members for which a function returns a true value."""
    wanted = callable_of(world, function)
    return world.new_list([member for member in calls(world, this.l) if world.invoke(wanted, this, (member,))])


@TABLE.primitive("all")
def all_(world: World, this: List, function: Value) -> bool:
    """Whether a function returns a true value for every member; stops at the first member for which it does not."""
    wanted = callable_of(world, function)
    return all(bool(world.invoke(wanted, this, (member,))) for member in calls(world, this.l))


@TABLE.primitive("any")
def any_(world: World, this: List, function: Value) -> bool:
    """Whether a function returns a true value for some member; stops at the first such member."""
    wanted = callable_of(world, function)
    return any(bool(world.invoke(wanted, this, (member,))) for member in calls(world, this.l))


@TABLE.primitive("foldl")
def foldl(world: World, this: List, function: Value, value: Value) -> Value:
    """Combine ``value`` with every member from left to right, using a function of two arguments."""
    wanted = callable_of(world, function)
    for member in calls(world, this.l):
        value = world.invoke(wanted, this, (value, member))
        if value is world.void:
            raise errors.unexpected_void()
    return value


@TABLE.primitive("zip")
def zip_(world: World, this: List, function: Value, other: list[Value]) -> Value:
    """The list of a function's results for each member and the member at the same index of the other list."""
    wanted = callable_of(world, function)
    pairs = zip(calls(world, this.l), calls(world, other), strict=False)
    return world.new_list([world.invoke(wanted, this, pair) for pair in pairs])


@TABLE.primitive("matchAgainst")
def match_against(world: World, this: list[Value], handler: Value, pattern: Any) -> bool:
    """Whether a pattern (a List of the same size) matches; its members are compared by the handler's
    ``matchPattern``.
    """
    if not isinstance(pattern, List) or len(pattern.l) != len(this):
        return False
    pairs = zip(in_slices(world, pattern.l), in_slices(world, this), strict=True)
    return all(bool(world.send(handler, "matchPattern", inner, member)) for inner, member in pairs)


# ---------------------------------------------------------------- changing


@TABLE.raw("<<", "insertBack", least=1)
def insert_back(world: World) -> Any:
    """Add a member at the end; returns this list."""

    def run(this: Value, value: Value) -> Value:
        (this.l if this.__class__ is List else _list(world, this)).append(value)
        if this.meta is not None:
            this.touch()
        return this

    return run


@TABLE.primitive("insertFront")
def insert_front(world: World, this: List, value: Value) -> Value:
    """Add a member at the beginning; returns this list."""
    this.l.insert(0, value)
    this.touch()
    return this


@TABLE.primitive("insert")
def insert(world: World, this: List, where: Any, value: Value) -> Value:
    """Insert a member before the one at a valid index; returns this list."""
    this.l.insert(index_in(len(this.l), where, world), value)
    this.touch()
    return this


@TABLE.raw("[]=", least=2)
def set_item(world: World) -> Any:
    """Replace the member at an index; returns the value."""

    def run(this: Value, index: Value, value: Value) -> Value:
        members = _list(world, this)
        members[index_in(len(members), index, world)] = value
        this.touch()
        return value

    return run


@TABLE.primitive("clear")
def clear(world: World, this: List) -> Value:
    """Remove all members; returns this list."""
    this.l.clear()
    this.touch()
    return this


@TABLE.primitive("remove")
def remove(world: World, this: List, value: Value) -> Value:
    """Remove all members equal to a value; returns this list."""
    gone = {id(member): member for member in in_slices(world, this.l) if equal(world, member, value)}
    _leave_out(this, gone)
    return this


@TABLE.primitive("removeById")
def remove_by_id(world: World, this: List, value: Value) -> Value:
    """Remove all occurrences of a value, compared by identity; returns this list."""
    _leave_out(this, {id(value): value})
    return this


def _leave_out(this: List, gone: dict[int, Any]) -> None:
    """Remove members by identity, in one step: other jobs may have changed the list since the members were selected."""
    if gone:
        this.l[:] = [member for member in this.l if id(member) not in gone]
        this.touch()


@TABLE.primitive("removeFront")
def remove_front(world: World, this: List) -> Value:
    """Remove the first member and return it.  Raises an error if the list is empty."""
    value = _filled(this.l).pop(0)
    this.touch()
    return value


@TABLE.primitive("removeBack")
def remove_back(world: World, this: List) -> Value:
    """Remove the last member and return it.  Raises an error if the list is empty."""
    value = _filled(this.l).pop()
    this.touch()
    return value


def _bounded(members: list[Value], more: list[Value]) -> list[Any]:
    """Return the second of two lists that will be joined.  Raises an error if the result would be too long."""
    if len(members) + len(more) > MAX_LIST_LENGTH:
        raise too_long("members", MAX_LIST_LENGTH)
    return more


@TABLE.primitive("+=")
def extend(world: World, this: List, that: list[Value]) -> Value:
    """Add the members of another list at the end of this one; returns this list."""
    this.l.extend(_bounded(this.l, list(that)))
    this.touch()
    return this


@TABLE.primitive("append")
def append(world: World, this: List, that: list[Value]) -> Value:
    """Deprecated: use ``+=``."""
    deprecated(world, "list.append(that)", "list += that")
    this.l.extend(_bounded(this.l, list(that)))
    this.touch()
    return this


# ---------------------------------------------------------------- new lists by operators


@TABLE.raw("+", least=1)
def plus(world: World) -> Any:
    """A new list with the members of both."""

    def run(this: Value, other: Value) -> Value:
        members = _list(world, this)
        return world.new_list(members + _bounded(members, _list(world, other, 1)))

    return run


@TABLE.primitive("-")
def minus(world: World, this: list[Value], other: list[Value]) -> Value:
    """A new list with the members that are not equal to any member of the other list."""
    gone = list(other)
    kept = [m for m in in_slices(world, this) if not any(equal(world, m, value) for value in in_slices(world, gone))]
    return world.new_list(kept)


@TABLE.primitive("*")
def times(world: World, this: list[Value], number: Value) -> Value:
    """A new list that repeats the members a non-negative number of times."""
    return world.new_list(this * repetitions(world, number, len(this), MAX_LIST_LENGTH, "members"))
