"""Tuple, Pair and Triplet: a fixed number of values.

Source: manual, specs/tuple, specs/pair, specs/triplet.
"""

from __future__ import annotations

from typing import Any, ClassVar

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import Tuple
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.members import index_in, less_members, same_members
from urbihw.kernel.stdlib.slices import NestedWalk, in_slices
from urbihw.kernel.value import Value

__breakable__ = True

TUPLE = Table("Tuple")
PAIR = Table("Pair")
TRIPLET = Table("Triplet")
TABLES = [TUPLE, PAIR, TRIPLET]

NOTES = {
    "Tuple": "A fixed number of values of any type.",
    "Pair": "A Tuple of two values.",
    "Triplet": "A Tuple of three values.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class Named(Tuple):
    """A tuple whose members are slots, so that a clone shares those of its prototype until they are written."""

    __slots__ = ()
    NAMES: ClassVar[tuple[str, ...]] = ()

    def __init__(self, world: World, protos: list[Obj], members: list[Value] | None = None) -> None:
        super().__init__(world, protos, members or [])

    @property
    def l(self) -> list[Any]:  # noqa: E743
        """The members of the tuple."""
        return [self.world.get_slot(self, name) for name in self.NAMES]

    @l.setter
    def l(self, members: list[Value]) -> None:  # noqa: E743
        for name, member in zip(self.NAMES, members, strict=False):
            self.world.ops.put_slot(self, name, member)

    def clone(self) -> Named:
        """A clone that shares the members of this one."""
        return type(self)(self.world, [self])


class Pair(Named):
    """A Tuple of two values."""

    __slots__ = ()
    NAMES = ("first", "second")


class Triplet(Named):
    """A Tuple of three values."""

    __slots__ = ()
    NAMES = ("first", "second", "third")


def _nothing(kind: type[Named]) -> Any:
    return lambda world, protos: kind(world, protos, [world.nil] * len(kind.NAMES))


CLASSES = {"Pair": _nothing(Pair), "Triplet": _nothing(Triplet)}
PROTOS = {"Pair": ("Tuple",), "Triplet": ("Tuple",)}


def pair(world: World, first: Value, second: Value) -> Obj:
    """Make a Pair of two values."""
    return Pair(world, [world.classes["Pair"]], [first, second])


# ---------------------------------------------------------------- Tuple


@TUPLE.primitive("init")
def init(world: World, this: Tuple, members: list[Value]) -> None:
    """Make a tuple of the members of a List."""
    this.l = list(members)


@TUPLE.primitive("asString", "asPrintable")
def as_string(world: World, this: Tuple) -> str:
    """The members' ``asPrintable`` in parentheses, as a literal; ``(...)`` for a tuple within itself."""
    with NestedWalk(world, this) as walk:
        if walk.inside:
            return "(...)"
        content = ", ".join([world.printable(member) for member in walk.members(this.l)])
    return f"({content},)" if len(this.l) == 1 else f"({content})"


@TUPLE.primitive("size")
def size(world: World, this: Tuple) -> float:
    """The number of members."""
    return float(len(this.l))


@TUPLE.primitive("[]")
def get_item(world: World, this: Tuple, index: Value) -> Value:
    """The member at an index; negative indexes count from the end."""
    return this.l[index_in(len(this.l), index, world)]


@TUPLE.primitive("[]=")
def set_item(world: World, this: Tuple, index: Value, value: Value) -> Value:
    """Replace the member at an index; returns the value."""
    this.l[index_in(len(this.l), index, world)] = value
    this.touch()
    return value


@TUPLE.primitive("==")
def equals(world: World, this: Tuple, other: Value) -> bool:
    """Whether the other value is a tuple of the same size with equal members."""
    return isinstance(other, Tuple) and same_members(world, this.l, other.l)


@TUPLE.primitive("!=")
def differs(world: World, this: Tuple, other: Value) -> bool:
    """``!(this == other)``."""
    return not (isinstance(other, Tuple) and same_members(world, this.l, other.l))


@TUPLE.primitive("<")
def before(world: World, this: Tuple, other: Tuple) -> bool:
    """Whether this tuple comes before the other in lexicographic order."""
    return less_members(world, this.l, other.l)


@TUPLE.primitive("*")
def times(world: World, this: Tuple, factor: Value) -> Value:
    """The tuple of the products of the members and a factor."""
    return world.new_tuple([world.send(member, "*", factor) for member in in_slices(world, this.l)])


@TUPLE.primitive("+")
def plus(world: World, this: Tuple, other: Tuple) -> Value:
    """The tuple of the sums of the members of two tuples of the same size."""
    if len(this.l) != len(other.l):
        raise errors.primitive(f"tuples of different sizes: {len(this.l)} and {len(other.l)}")
    pairs = zip(in_slices(world, this.l), in_slices(world, other.l), strict=True)
    return world.new_tuple([world.send(a, "+", b) for a, b in pairs])


@TUPLE.primitive("matchAgainst")
def match_against(world: World, this: Tuple, handler: Value, pattern: Any) -> bool:
    """Whether a pattern (a Tuple of the same size) matches; its members are compared by the handler's
    ``matchPattern``.
    """
    if not isinstance(pattern, Tuple) or len(pattern.l) != len(this.l):
        return False
    pairs = zip(in_slices(world, pattern.l), in_slices(world, this.l), strict=True)
    return all(bool(world.send(handler, "matchPattern", inner, member)) for inner, member in pairs)


# ---------------------------------------------------------------- Pair and Triplet


@PAIR.primitive("init")
def init_pair(world: World, this: Pair, first: Value, second: Value) -> None:
    """Make a Pair of two values."""
    this.l = [first, second]


@TRIPLET.primitive("init")
def init_triplet(world: World, this: Triplet, first: Value, second: Value, third: Value) -> None:
    """Make a Triplet of three values."""
    this.l = [first, second, third]


@PAIR.primitive("[]=")
@TRIPLET.primitive("[]=")
def set_member(world: World, this: Named, index: Value, value: Value) -> Value:
    """Replace the member at an index; returns the value."""
    world.ops.put_slot(this, this.NAMES[index_in(len(this.NAMES), index, world)], value)
    this.touch()
    return value


@PAIR.primitive("asString", "asPrintable")
def pair_string(world: World, this: Value) -> str:
    """The members in parentheses, for any object with ``first`` and ``second``."""
    return _written(world, this, Pair.NAMES)


@TRIPLET.primitive("asString", "asPrintable")
def triplet_string(world: World, this: Value) -> str:
    """The members in parentheses, for any object with ``first``, ``second`` and ``third``."""
    return _written(world, this, Triplet.NAMES)


def _written(world: World, this: Value, names: tuple[str, ...]) -> str:
    return f"({', '.join([world.printable(world.send(this, name)) for name in names])})"
