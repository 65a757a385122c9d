"""Built-in functions: rows of a table that a world turns into Primitives.

::

    table = Table("Float")

    @table.primitive("atan2")
    def atan2(world: World, this: float, x: float) -> float: ...

The types of the parameters, ``this`` included, are checked (module ``arguments``).  Parameters with defaults may be
left out, ``*args`` takes any number.  The return value is converted to an urbiscript value (None to void), unless it is
annotated ``Value`` or ``Any``.

``raw`` rows are factories ``make(world)`` of a function ``fn(this, *args)`` without any check, or of ``Forms``: for the
few hot ones.
``lazy`` rows take the call message: ``fn(world, message)``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

from urbihw.kernel.runtime.arguments import Check, annotated_type
from urbihw.kernel.runtime.code import DirectPrimitive, LazyPrimitive, Primitive, make_primitive
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.slots import LOGICAL
from urbihw.kernel.value import Value, ValueOrText

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

__breakable__ = True

Function = Callable[..., Any]


class Forms(NamedTuple):
    """A raw built-in with forms of fixed arity beside the one for any number of arguments, which is slower."""

    run: Function
    none: Function | None = None
    one: Function | None = None
    two: Function | None = None
    takes_text: bool = False
    """Whether the first argument may be a Python str, see ``Executable``."""


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
        made = row.function(world)
        if isinstance(made, Forms):
            primitive = make_primitive(world, name, made.run, row.least, row.most, made[1:4])
            primitive.takes_text = made.takes_text
            return primitive
        return make_primitive(world, name, made, row.least, row.most)
    if row.kind == "lazy":
        function = row.function

        def run(message: Value) -> Value:
            return to_urbiscript(world, function(world, message))

        return LazyPrimitive(world, name, run, row.least, row.most)
    return CheckedPrimitive(world, name, row.function)


def to_urbiscript(world: World, value: Value) -> Value:
    """The urbiscript value for the return value of a built-in."""
    return value if value.__class__ is float else world.from_python(value)


class Arity(NamedTuple):
    """The numbers of arguments that a built-in takes."""

    least: int
    most: int
    """-1 for any number."""


def arity_of(function: Function) -> Arity:
    """The numbers of arguments of a checked built-in, beside ``world`` and ``this``."""
    code = function.__code__
    most = code.co_argcount - 2
    least = most - len(function.__defaults__ or ())
    return Arity(least, -1 if code.co_flags & inspect.CO_VARARGS else most)


class CheckedPrimitive(DirectPrimitive):
    """A built-in whose arguments are checked by the types of its parameters.

    A kernel has about a thousand, and a program uses a few of them.  So the functions that check and convert are made
    when one of them is wanted first: this is a third of the time in which a kernel is made.
    """

    __slots__ = ()

    def __init__(self, world: World, name: str, function: Function) -> None:
        Obj.__init__(self, world, [world.primitive_proto])
        self.strict = True
        self.name = name
        self.source = function
        self.least, self.most = arity_of(function)

    def __getattr__(self, slot: str) -> Any:
        """Called for a Python slot that is not set yet."""
        if slot not in _MADE_WHEN_CALLED:
            raise AttributeError(f"{type(self).__name__!r} has no {slot!r}")
        run, *forms, self.takes_text = _checked(self.world, self.source)
        least, most = self.least, self.most
        # The form for any number of arguments is slower and uses more C stack, which each sleeping job keeps.
        none, one, two = (
            form if least <= number and (most < 0 or number <= most) else None for number, form in enumerate(forms)
        )
        self.fill(run, (none, one, two))
        return getattr(self, slot)


_MADE_WHEN_CALLED = frozenset({"fn", "c0", "c1", "c2", "takes_text"})


def _checked(world: World, function: Function) -> Forms:
    """The forms of a checked built-in."""
    code = function.__code__
    names = code.co_varnames[1 : code.co_argcount]
    types = [annotated_type(function, name) for name in names]
    check_this, *check_args = map(world.checks.of, types)
    check_rest: Check | None = None
    if code.co_flags & inspect.CO_VARARGS:
        check_rest = world.checks.of(annotated_type(function, code.co_varnames[code.co_argcount]))
    returns_value = function.__annotations__.get("return") in ("Any", "Value")
    fixed = len(check_args)
    check_first, check_second = (*check_args, check_rest, check_rest)[:2]

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

    def run2(this: Value, first: Value, second: Value) -> Value:
        if check_this is not None:
            this = check_this(this, None)
        if check_first is not None:
            first = check_first(first, 1)
        if check_second is not None:
            second = check_second(second, 2)
        result = function(world, this, first, second)
        return result if returns_value or result.__class__ is float else world.from_python(result)

    return Forms(run, run0, run1, run2, takes_text=types[1:2] in ([str], [ValueOrText]))
