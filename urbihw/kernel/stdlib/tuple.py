"""Tuple, Pair and Triplet: a fixed number of members.

Source: manual, specs/tuple, specs/pair, specs/triplet.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import Tuple
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.members import index_in, less_members, same_members

TUPLE = Table("Tuple")
PAIR = Table("Pair")
TRIPLET = Table("Triplet")
TABLES = [TUPLE, PAIR, TRIPLET]


def _empty(size: int) -> Any:
    return lambda world, protos: Tuple(world, protos, [world.nil] * size)


CLASSES = {"Pair": _empty(2), "Triplet": _empty(3)}
PROTOS = {"Pair": ("Tuple",), "Triplet": ("Tuple",)}


def pair(world: World, first: Any, second: Any) -> Obj:
    """A Pair."""
    return Tuple(world, [world.global_.slots["Pair"]], [first, second])


# ---------------------------------------------------------------- Tuple


@TUPLE.primitive("init")
def init(world: World, this: Tuple, members: list[Any]) -> None:
    """A tuple of the members of a List."""
    this.l = list(members)


@TUPLE.primitive("asString", "asPrintable")
def as_string(world: World, this: Tuple) -> str:
    """The members' ``asPrintable`` in parentheses, as a tuple is written."""
    content = ", ".join([world.printable(member) for member in this.l])
    return f"({content},)" if len(this.l) == 1 else f"({content})"


@TUPLE.primitive("size")
def size(world: World, this: Tuple) -> float:
    """The number of members."""
    return float(len(this.l))


@TUPLE.primitive("[]")
def get_item(world: World, this: Tuple, index: Any) -> Any:
    """The member at an index; negative ones count from the end."""
    return this.l[index_in(len(this.l), index, world)]


@TUPLE.primitive("[]=")
def set_item(world: World, this: Tuple, index: Any, value: Any) -> Any:
    """Put a value at an index; gives the value."""
    this.l[index_in(len(this.l), index, world)] = value
    this.touch()
    return value


@TUPLE.primitive("==")
def equals(world: World, this: Tuple, other: Any) -> bool:
    """Whether the other is a tuple of as many members, equal one by one."""
    return isinstance(other, Tuple) and same_members(world, this.l, other.l)


@TUPLE.primitive("!=")
def differs(world: World, this: Tuple, other: Any) -> bool:
    """``!(this == other)``."""
    return not (isinstance(other, Tuple) and same_members(world, this.l, other.l))


@TUPLE.primitive("<")
def before(world: World, this: Tuple, other: Tuple) -> bool:
    """Whether this tuple comes before the other in lexicographic order."""
    return less_members(world, this.l, other.l)


@TUPLE.primitive("*")
def times(world: World, this: Tuple, factor: Any) -> Any:
    """The tuple of the members times a factor."""
    return world.new_tuple([world.send(member, "*", factor) for member in this.l])


@TUPLE.primitive("+")
def plus(world: World, this: Tuple, other: Tuple) -> Any:
    """The tuple of the sums of the members of two tuples of the same size."""
    if len(this.l) != len(other.l):
        raise errors.primitive(f"tuples of different sizes: {len(this.l)} and {len(other.l)}")
    return world.new_tuple([world.send(a, "+", b) for a, b in zip(this.l, other.l, strict=True)])


@TUPLE.primitive("matchAgainst")
def match_against(world: World, this: Tuple, handler: Any, pattern: Any) -> bool:
    """Whether a pattern (a Tuple of the same size) matches, its members asked of the handler's ``matchPattern``."""
    if not isinstance(pattern, Tuple) or len(pattern.l) != len(this.l):
        return False
    pairs = list(zip(pattern.l, this.l, strict=True))
    return all(bool(world.send(handler, "matchPattern", inner, member)) for inner, member in pairs)


# ---------------------------------------------------------------- Pair and Triplet


@PAIR.primitive("init")
def init_pair(world: World, this: Tuple, first: Any, second: Any) -> None:
    """A pair of two values."""
    this.l = [first, second]


@TRIPLET.primitive("init")
def init_triplet(world: World, this: Tuple, first: Any, second: Any, third: Any) -> None:
    """A triplet of three values."""
    this.l = [first, second, third]


@PAIR.primitive("first")
@TRIPLET.primitive("first")
def first(world: World, this: Tuple) -> Any:
    """The first member."""
    return this.l[0]


@PAIR.primitive("second")
@TRIPLET.primitive("second")
def second(world: World, this: Tuple) -> Any:
    """The second member."""
    return this.l[1]


@TRIPLET.primitive("third")
def third(world: World, this: Tuple) -> Any:
    """The third member."""
    return this.l[2]
