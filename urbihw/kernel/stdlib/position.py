"""Position: one character of a source text."""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.float import integer
from urbihw.kernel.stdlib.support import field

TABLE = Table("Position")
PROTOS = {"Position": ("Orderable", "Comparable")}

NOTES = {
    "Position.line": "The line, from 1; can be assigned.",
    "Position.column": "The column, from 1; can be assigned.",
    "Position.file": "The name of the file as a Path, nil for what was typed; can be assigned.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class PositionObject(Obj):
    """An urbiscript Position: line and column from 1, and the name of the text or None."""

    __slots__ = ("column", "file", "line")

    def __init__(
        self, world: World, protos: list[Obj], line: int = 1, column: int = 1, file: str | None = None
    ) -> None:
        super().__init__(world, protos)
        self.line = line
        self.column = column
        self.file = file

    def clone(self) -> PositionObject:
        """A fresh position at the same place."""
        return PositionObject(self.world, [self], self.line, self.column, self.file)

    def text(self) -> str:
        """``file:line.column``, or without file."""
        place = f"{self.line}.{self.column}"
        return place if self.file is None else f"{self.file}:{place}"


CLASSES = {"Position": PositionObject}


def make_position(world: World, line: int, column: int, file: str | None) -> PositionObject:
    """A Position."""
    proto: Any = world.classes["Position"]
    return PositionObject(world, [proto], line, column, file)


@TABLE.primitive("init")
def init(world: World, this: PositionObject, *args: Any) -> None:
    """Take the place of another Position, or (line, column), or (file, line, column)."""
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
        this.file = world.text(name[0]) if name else None


@TABLE.primitive("asString")
def as_string(world: World, this: PositionObject) -> str:
    """``file:line.column``, or without file."""
    return this.text()


def _moved(world: World, this: PositionObject, columns: int) -> PositionObject:
    return make_position(world, this.line, max(1, this.column + columns), this.file)


@TABLE.primitive("+", "columns")
def right(world: World, this: PositionObject, columns: int) -> Any:
    """The position some columns further right, column 1 at least."""
    return _moved(world, this, columns)


@TABLE.primitive("-")
def left(world: World, this: PositionObject, columns: int) -> Any:
    """The position some columns further left, column 1 at least."""
    return _moved(world, this, -columns)


@TABLE.primitive("lines")
def lines(world: World, this: PositionObject, count: int) -> Any:
    """The first column some lines further down, line 1 at least."""
    return make_position(world, max(1, this.line + count), 1, this.file)


@TABLE.primitive("==")
def equal(world: World, this: PositionObject, that: Any) -> bool:
    """Whether line and column are the same."""
    return isinstance(that, PositionObject) and (this.line, this.column) == (that.line, that.column)


@TABLE.primitive("<")
def less(world: World, this: PositionObject, that: PositionObject) -> bool:
    """Whether this comes before the argument."""
    return (this.line, this.column) < (that.line, that.column)


def install(world: World, programs: Any) -> None:
    """The fields ``line``, ``column`` and ``file`` (a Path, or nil)."""
    proto = prototype(world, "Position")

    def write_line(this: Any, value: Any) -> None:
        this.line = integer(world, value, 1, "line")

    def write_column(this: Any, value: Any) -> None:
        this.column = integer(world, value, 1, "column")

    def read_file(this: Any) -> Any:
        if this.file is None:
            return world.nil
        return world.send(world.classes["Path"], "new", world.string(this.file))

    def write_file(this: Any, value: Any) -> None:
        this.file = None if value is world.nil else value.s if isinstance(value, String) else world.text(value)

    field(world, proto, "line", lambda this: float(this.line), write_line, PositionObject)
    field(world, proto, "column", lambda this: float(this.column), write_column, PositionObject)
    field(world, proto, "file", read_file, write_file, PositionObject)
