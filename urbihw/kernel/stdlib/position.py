"""Position: a line and a column in a source text."""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import current_stack
from urbihw.kernel.runtime.location import PositionObject, make_position
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.float import integer
from urbihw.kernel.stdlib.support import field
from urbihw.kernel.value import Value

TABLE = Table("Position")
GLOBAL = Table("Global")
TABLES = [TABLE, GLOBAL]
PROTOS = {"Position": ("Object",)}

NOTES = {
    "Position.line": "The line, from 1; can be assigned.",
    "Position.column": "The column, from 1; can be assigned.",
    "Position.file": "The name of the file as a Path, nil for console input; can be assigned.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


CLASSES = {"Position": PositionObject}


@TABLE.primitive("init")
def init(world: World, this: PositionObject, *args: Value) -> None:
    """Make a Position from another Position, from (line, column), or from (file, line, column)."""
    if len(args) > 3:
        raise errors.arity(len(args), 0, 3)
    if len(args) == 1:
        other = args[0]
        if not isinstance(other, PositionObject):
            raise world.type_error(1, other, "Position")
        this.line, this.column, this.file = other.line, other.column, other.file
    elif args:
        *name, line, column = args
        this.line = integer(world, line, len(args) - 1, "new")
        this.column = integer(world, column, len(args), "new")
        this.file = world.text(name[0]) if name and name[0] is not world.nil else None


@GLOBAL.primitive("__HERE__")
def here(world: World, this: Value) -> Value:
    """The Position in the source text where this name stands (manual, release notes of 2.0 beta 3)."""
    place = current_stack().location
    return world.nil if place is None else make_position(world, *place.begin)


@TABLE.primitive("asString")
def as_string(world: World, this: PositionObject) -> str:
    """``file:line.column``, or ``line.column`` without a file."""
    return this.text()


def _moved(world: World, this: PositionObject, columns: int) -> PositionObject:
    return make_position(world, this.line, max(1, this.column + columns), this.file)


@TABLE.primitive("+", "columns")
def right(world: World, this: PositionObject, columns: int) -> Value:
    """The position ``columns`` further right; the column is at least 1."""
    return _moved(world, this, columns)


@TABLE.primitive("-")
def left(world: World, this: PositionObject, columns: int) -> Value:
    """The position ``columns`` further left; the column is at least 1."""
    return _moved(world, this, -columns)


@TABLE.primitive("lines")
def lines(world: World, this: PositionObject, count: int) -> Value:
    """The first column of the line that is ``count`` lines further down; the line is at least 1."""
    return make_position(world, max(1, this.line + count), 1, this.file)


@TABLE.primitive("==")
def equal(world: World, this: PositionObject, that: Value) -> bool:
    """Whether both have the same line and column."""
    return isinstance(that, PositionObject) and (this.line, this.column) == (that.line, that.column)


@TABLE.primitive("<")
def less(world: World, this: PositionObject, that: PositionObject) -> bool:
    """Whether this position is before the argument."""
    return (this.line, this.column) < (that.line, that.column)


def install(world: World, programs: Any) -> None:
    """Make the fields ``line``, ``column`` and ``file`` (a Path, or nil)."""
    proto = prototype(world, "Position")

    def write_line(this: Value, value: Value) -> None:
        this.line = integer(world, value, 1, "line")

    def write_column(this: Value, value: Value) -> None:
        this.column = integer(world, value, 1, "column")

    def read_file(this: Value) -> Value:
        if this.file is None:
            return world.nil
        return world.send(world.classes["Path"], "new", world.string(this.file))

    def write_file(this: Value, value: Value) -> None:
        this.file = None if value is world.nil else value.s if isinstance(value, String) else world.text(value)

    field(world, proto, "line", lambda this: float(this.line), write_line, PositionObject)
    field(world, proto, "column", lambda this: float(this.column), write_column, PositionObject)
    field(world, proto, "file", read_file, write_file, PositionObject)
