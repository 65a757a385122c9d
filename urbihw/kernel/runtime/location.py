"""The place of an error as urbiscript values: Position, Location, and the StackFrames of its calls.

Errors carry these values, so they are made here; their urbiscript methods are in the library.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.backtrace import Stack
from urbihw.kernel.runtime.object import Obj, Plain

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World


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
        """A new position at the same place."""
        return PositionObject(self.world, [self], self.line, self.column, self.file)

    def text(self) -> str:
        """``file:line.column``, or without file."""
        place = f"{self.line}.{self.column}"
        return place if self.file is None else f"{self.file}:{place}"


class LocationObject(Obj):
    """An urbiscript Location: the first position, and the one past the last."""

    __slots__ = ("begin", "end")

    def __init__(self, world: World, protos: list[Obj], begin: PositionObject | None = None) -> None:
        super().__init__(world, protos)
        self.begin = begin if begin is not None else PositionObject(world, [world.object])
        self.end = self.begin

    def clone(self) -> LocationObject:
        """A new location of the same place."""
        made = LocationObject(self.world, [self], copy_position(self.world, self.begin))
        made.end = copy_position(self.world, self.end)
        return made

    def text(self) -> str:
        """``file:line.column-line.column``, as short as possible; the end is that of the last character."""
        begin, end = self.begin, self.end
        last = max(end.column - 1, 0)
        if begin.line != end.line:
            return f"{begin.text()}-{end.line}.{last}"
        return begin.text() if end.column in (begin.column, begin.column + 1) else f"{begin.text()}-{last}"


def make_position(world: World, line: int, column: int, file: str | None) -> PositionObject:
    """Make a Position of a line and a column."""
    proto: Any = world.classes["Position"]
    return PositionObject(world, [proto], line, column, file)


def copy_position(world: World, position: PositionObject) -> PositionObject:
    """A Position of the same place."""
    return make_position(world, position.line, position.column, position.file)


def make_location(world: World, location: Any) -> Any:
    """The Location for a place of the syntax tree; nil for none."""
    if location is None:
        return world.nil
    begin, end = location
    proto: Any = world.classes["Location"]
    made = LocationObject(world, [proto], make_position(world, begin.line, begin.column, begin.file))
    made.end = make_position(world, end.line, end.column, end.file)
    return made


def make_frames(world: World, stack: Stack) -> Any:
    """The calls of a stack as a List of StackFrames, innermost first."""
    proto: Any = world.classes["StackFrame"]
    frames: list[Any] = []
    for step in stack.calls:
        frame = Plain(world, [proto])
        frame.slots["name"] = world.string(step.name or "")
        frame.slots["location"] = make_location(world, step.location)
        frames.append(frame)
    return world.new_list(frames)
