"""Built-in functions: rows of a table that a world turns into Primitives.

::

    table = Table("Float")

    @table.primitive("atan2")
    def atan2(world: World, this: float, x: float) -> float: ...

The types of the parameters are the checks: ``float`` wants a Float, ``int`` a Float of integral value, ``str`` a
String (given as a Python str), ``bool`` anything (given as its truth), ``list`` a List (given as its Python list),
``Any`` any value as it is; a class of the runtime wants
one of that class.  ``this`` is checked in the same way.  Parameters with defaults may be left out, ``*args`` takes any
number.  What the function returns becomes an urbiscript value (None is void); annotated ``Any`` it is one already.

``raw`` rows are factories ``make(world)`` of a function ``fn(this, *args)`` without any check: for the hot few.
``lazy`` rows take the call message: ``fn(world, message)``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import LazyPrimitive, Primitive, make_primitive
from urbihw.kernel.runtime.slots import LOGICAL
from urbihw.kernel.runtime.values import FloatObject, List, String

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

__breakable__ = True

Function = Callable[..., Any]
Check = Callable[[Any, int | None], Any]


class Row(NamedTuple):
    """One built-in: its slot names, the Python function, how it is called."""

    names: tuple[str, ...]
    function: Function
    kind: str
    least: int
    most: int


class Table:
    """The built-ins of one urbiscript class."""

    def __init__(self, proto: str) -> None:
        self.proto = proto
        self.rows: list[Row] = []

    def primitive(self, *names: str) -> Callable[[Function], Function]:
        """A checked built-in, under one or several names."""

        def add(function: Function) -> Function:
            self.rows.append(Row(names, function, "checked", 0, 0))
            return function

        return add

    def raw(self, *names: str, least: int, most: int | None = None) -> Callable[[Function], Function]:
        """An unchecked built-in given by a factory."""

        def add(function: Function) -> Function:
            self.rows.append(Row(names, function, "raw", least, least if most is None else most))
            return function

        return add

    def lazy(self, *names: str, least: int, most: int) -> Callable[[Function], Function]:
        """A built-in that takes the call message; most -1 is any number."""

        def add(function: Function) -> Function:
            self.rows.append(Row(names, function, "lazy", least, most))
            return function

        return add

    def install(self, world: World, proto: Any) -> None:
        """Make the Primitives of this table slots of ``proto``."""
        for row in self.rows:
            for name in row.names:
                proto.slots[name] = build(world, name, row)
                if row.kind == "lazy" and name not in LOGICAL:
                    world.lazy_names.add(name)
        world.flush()


def build(world: World, name: str, row: Row) -> Primitive:
    """The Primitive for a row."""
    made = _build(world, name, row)
    made.source = row.function
    return made


def _build(world: World, name: str, row: Row) -> Primitive:
    if row.kind == "raw":
        return make_primitive(world, name, row.function(world), row.least, row.most)
    if row.kind == "lazy":
        function = row.function

        def run(message: Any) -> Any:
            return give(world, function(world, message))

        return LazyPrimitive(world, name, run, row.least, row.most)
    return _checked(world, name, row.function)


def give(world: World, value: Any) -> Any:
    """The urbiscript value for what a built-in returned."""
    return value if value.__class__ is float else world.from_python(value)


def _checked(world: World, name: str, function: Function) -> Primitive:
    # read off the code object: inspect.signature would double the time that the library takes to start
    code, notes = function.__code__, function.__annotations__
    names = code.co_varnames[1 : code.co_argcount]
    variadic = bool(code.co_flags & inspect.CO_VARARGS)
    most = len(names) - 1
    least = most - len(function.__defaults__ or ())
    checks = [_check(world, str(notes.get(name, "Any"))) for name in names]
    check_rest: Check | None = None
    if variadic:
        most = -1
        check_rest = _check(world, str(notes.get(code.co_varnames[code.co_argcount], "Any")))
    raw_result = str(notes.get("return", "")) == "Any"
    check_this, *check_args = checks
    fixed = len(check_args)

    def run(this: Any, *args: Any) -> Any:
        if check_this is not None:
            this = check_this(this, None)
        given = [
            argument if check is None else check(argument, index)
            for index, (argument, check) in enumerate(zip(args, check_args, strict=False), 1)
        ]
        rest = args[fixed:]
        given += rest if check_rest is None else map(check_rest, rest, count(fixed + 1))
        result = function(world, this, *given)
        return result if raw_result or result.__class__ is float else world.from_python(result)

    def run0(this: Any) -> Any:
        if check_this is not None:
            this = check_this(this, None)
        result = function(world, this)
        return result if raw_result or result.__class__ is float else world.from_python(result)

    check_first = check_args[0] if check_args else check_rest

    def run1(this: Any, argument: Any) -> Any:
        if check_this is not None:
            this = check_this(this, None)
        if check_first is not None:
            argument = check_first(argument, 1)
        result = function(world, this, argument)
        return result if raw_result or result.__class__ is float else world.from_python(result)

    # The way for any number is slower, and deeper in C, whose stack each sleeping job keeps.
    takes_one = least <= 1 and (most < 0 or most >= 1)
    return make_primitive(
        world, name, run, least, most, (None if least else run0, run1 if takes_one else None, None)
    )


def _check(world: World, annotation: str) -> Check | None:
    kind = annotation.removesuffix(" | None")
    if kind in ("Any", "object"):
        return None
    if kind in ("float", "int", "str", "bool", "list[Any]", "list"):
        return _python_check(world, kind)
    wanted = kind
    known: dict[type, bool] = {}

    def check_class(value: Any, index: int | None) -> Any:
        cls = value.__class__
        if cls not in known:
            known[cls] = any(base.__name__ == wanted for base in cls.__mro__)
        if known[cls]:
            return value
        raise world.type_error(index, value, wanted.removesuffix("Object"))

    return check_class


def _python_check(world: World, kind: str) -> Check:
    def check_float(value: Any, index: int | None) -> Any:
        if value.__class__ is not float:
            if isinstance(value, FloatObject):
                return value.value
            raise world.type_error(index, value, "Float")
        return value

    def check_int(value: Any, index: int | None) -> Any:
        value = check_float(value, index)
        if value != value or value in (float("inf"), float("-inf")) or value != int(value):
            raise errors.bad_number("BadInteger", f"expected integer, got {world.text(value)}")
        return int(value)

    def check_str(value: Any, index: int | None) -> Any:
        if not isinstance(value, String):
            raise world.type_error(index, value, "String")
        return value.s

    def check_list(value: Any, index: int | None) -> Any:
        if not isinstance(value, List):
            raise world.type_error(index, value, "List")
        return value.l

    def check_bool(value: Any, index: int | None) -> Any:
        return bool(value)

    return {
        "float": check_float,
        "int": check_int,
        "str": check_str,
        "list": check_list,
        "list[Any]": check_list,
        "bool": check_bool,
    }[kind]
