"""Built-in functions: rows of a table that a world turns into Primitives.

::

    table = Table("Float")

    @table.primitive("atan2")
    def atan2(world: World, this: float, x: float) -> float: ...

The types of the parameters, ``this`` included, are checked (module ``arguments``).  Parameters with defaults may be
left out, ``*args`` takes any number.  The return value is converted to an urbiscript value (None to void), unless it is
annotated ``Value`` or ``Any``.

``raw`` rows are factories ``make(world)`` of a function ``fn(this, *args)`` without any check: for the few hot ones.
``lazy`` rows take the call message: ``fn(world, message)``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

from urbihw.kernel.runtime.arguments import Check, annotated_type
from urbihw.kernel.runtime.code import LazyPrimitive, Primitive, make_primitive
from urbihw.kernel.runtime.slots import LOGICAL
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

__breakable__ = True

Function = Callable[..., Any]


class PrimitiveRow(NamedTuple):
    """One built-in: its slot names, the Python function, and the kind of call."""

    names: tuple[str, ...]
    function: Function
    kind: str
    least: int
    most: int


class Table:
    """The built-ins of one urbiscript class."""

    def __init__(self, proto: str) -> None:
        self.proto = proto
        self.rows: list[PrimitiveRow] = []

    def primitive(self, *names: str) -> Callable[[Function], Function]:
        """A checked built-in, under one or several names."""

        def add(function: Function) -> Function:
            self.rows.append(PrimitiveRow(names, function, "checked", 0, 0))
            return function

        return add

    def raw(self, *names: str, least: int, most: int | None = None) -> Callable[[Function], Function]:
        """An unchecked built-in given by a factory."""

        def add(function: Function) -> Function:
            self.rows.append(PrimitiveRow(names, function, "raw", least, least if most is None else most))
            return function

        return add

    def lazy(self, *names: str, least: int, most: int) -> Callable[[Function], Function]:
        """A built-in that takes the call message; most -1 is any number."""

        def add(function: Function) -> Function:
            self.rows.append(PrimitiveRow(names, function, "lazy", least, most))
            return function

        return add

    def install(self, world: World, proto: Value) -> None:
        """Put the Primitives of this table into slots of ``proto``.

        ``proto`` gets a ``meta`` table although it is empty, so that assignments to its slots take the slow path, which
        detects that a built-in operator is replaced.
        """
        if proto.meta is None:
            proto.meta = {}
        for row in self.rows:
            for name in row.names:
                proto.slots[name] = build(world, name, row)
                if row.kind == "lazy" and name not in LOGICAL:
                    world.lazy_names.add(name)
        world.flush()


def build(world: World, name: str, row: PrimitiveRow) -> Primitive:
    """The Primitive for a row."""
    made = _build(world, name, row)
    made.source = row.function
    return made


def _build(world: World, name: str, row: PrimitiveRow) -> Primitive:
    if row.kind == "raw":
        return make_primitive(world, name, row.function(world), row.least, row.most)
    if row.kind == "lazy":
        function = row.function

        def run(message: Value) -> Value:
            return to_urbiscript(world, function(world, message))

        return LazyPrimitive(world, name, run, row.least, row.most)
    return _checked(world, name, row.function)


def to_urbiscript(world: World, value: Value) -> Value:
    """The urbiscript value for the return value of a built-in."""
    return value if value.__class__ is float else world.from_python(value)


class Signature(NamedTuple):
    """The checks of a built-in's arguments (None: no check) and the number of its arguments."""

    check_this: Check | None
    check_args: list[Check | None]
    check_rest: Check | None
    """The check of each further argument."""
    least: int
    most: int
    """-1 for any number."""
    returns_value: bool
    """Whether it returns an urbiscript value, which needs no conversion."""


def _signature(world: World, function: Function) -> Signature:
    code = function.__code__
    names = code.co_varnames[1 : code.co_argcount]
    check_this, *check_args = [world.checks.of(annotated_type(function, name)) for name in names]
    most = len(check_args)
    least = most - len(function.__defaults__ or ())
    check_rest: Check | None = None
    if code.co_flags & inspect.CO_VARARGS:
        most = -1
        check_rest = world.checks.of(annotated_type(function, code.co_varnames[code.co_argcount]))
    returns_value = function.__annotations__.get("return") in ("Any", "Value")
    return Signature(check_this, check_args, check_rest, least, most, returns_value)


def _checked(world: World, name: str, function: Function) -> Primitive:
    check_this, check_args, check_rest, least, most, returns_value = _signature(world, function)
    fixed = len(check_args)
    check_first = check_args[0] if check_args else check_rest

    # The functions needed at each call are local variables, so that a call needs no look-ups.
    def run(this: Value, *args: Value) -> Value:
        if check_this is not None:
            this = check_this(this, None)
        given = [
            argument if check is None else check(argument, index)
            for index, (argument, check) in enumerate(zip(args, check_args, strict=False), 1)
        ]
        rest = args[fixed:]
        given += rest if check_rest is None else map(check_rest, rest, count(fixed + 1))
        result = function(world, this, *given)
        return result if returns_value or result.__class__ is float else world.from_python(result)

    def run0(this: Value) -> Value:
        if check_this is not None:
            this = check_this(this, None)
        result = function(world, this)
        return result if returns_value or result.__class__ is float else world.from_python(result)

    def run1(this: Value, argument: Value) -> Value:
        if check_this is not None:
            this = check_this(this, None)
        if check_first is not None:
            argument = check_first(argument, 1)
        result = function(world, this, argument)
        return result if returns_value or result.__class__ is float else world.from_python(result)

    # The form for any number of arguments is slower and uses more C stack, which each sleeping job keeps.
    takes_one = least <= 1 and (most < 0 or most >= 1)
    direct = (None if least else run0, run1 if takes_one else None, None)
    return make_primitive(world, name, run, least, most, direct)
