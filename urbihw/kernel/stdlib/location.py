"""Location and StackFrame: where errors happen, and through which calls."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.backtrace import Stack
from urbihw.kernel.runtime.object import Obj, Plain
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.position import PositionObject, make_position
from urbihw.kernel.stdlib.support import field

LOCATION = Table("Location")
FRAME = Table("StackFrame")
TABLES = (LOCATION, FRAME)

NOTES = {
    "Location": "A piece of a source text, from one Position to another.",
    "StackFrame": "One call of those that led to an error.",
    "Location.begin": "The Position where it begins; can be assigned.",
    "Location.end": "The Position of the character behind its last; can be assigned.",
    "StackFrame.name": "The name of what was called.",
    "StackFrame.location": "The Location of the call.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class LocationObject(Obj):
    """An urbiscript Location: the first position, and the one past the last."""

    __slots__ = ("begin", "end")

    def __init__(self, world: World, protos: list[Obj], begin: PositionObject | None = None) -> None:
        super().__init__(world, protos)
        self.begin = begin if begin is not None else PositionObject(world, [world.object])
        self.end = self.begin

    def clone(self) -> LocationObject:
        """A fresh location of the same place."""
        made = LocationObject(self.world, [self], _copy(self.world, self.begin))
        made.end = _copy(self.world, self.end)
        return made

    def text(self) -> str:
        """``file:line.column-line.column``, as short as possible; the end shown is the last character."""
        begin, end = self.begin, self.end
        last = max(end.column - 1, 0)
        if begin.line != end.line:
            return f"{begin.text()}-{end.line}.{last}"
        return begin.text() if end.column in (begin.column, begin.column + 1) else f"{begin.text()}-{last}"


CLASSES = {"Location": LocationObject}


def _copy(world: World, position: PositionObject) -> PositionObject:
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


@LOCATION.primitive("init")
def init(world: World, this: LocationObject, begin: Any = None, end: Any = None) -> None:
    """Without argument 1.1; from one Position, or from two."""
    for index, position in enumerate((begin, end), 1):
        if position is not None and not isinstance(position, PositionObject):
            raise world.type_error(index, position, "Position")
    this.begin = make_position(world, 1, 1, None) if begin is None else _copy(world, begin)
    this.end = _copy(world, this.begin if end is None else end)


@LOCATION.primitive("asString")
def as_string(world: World, this: LocationObject) -> str:
    """``file:line.column-line.column``, as short as possible."""
    return this.text()


@LOCATION.primitive("==")
def equal(world: World, this: LocationObject, that: Any) -> bool:
    """Whether both begin and end at the same places."""
    return isinstance(that, LocationObject) and _places(this) == _places(that)


def _places(this: LocationObject) -> tuple[int, ...]:
    return this.begin.line, this.begin.column, this.end.line, this.end.column


@FRAME.primitive("init")
def init_frame(world: World, this: Obj, name: Any, location: Any) -> None:
    """The name of the function called, and the Location of the call."""
    this.slots["name"] = name
    this.slots["location"] = location


@FRAME.primitive("asString")
def frame_string(world: World, this: Obj) -> str:
    """``location: name``."""
    if "name" not in this.slots:
        return "StackFrame"
    return f"{world.text(this.slots['location'])}: {world.text(this.slots['name'])}"


def make_frames(world: World, stack: Stack) -> Any:
    """The calls of a stack as a List of StackFrames, innermost first."""
    proto: Any = world.classes["StackFrame"]
    frames: list[Any] = []
    for step in stack.calls:
        frame = Plain(world, [proto])
        init_frame(world, frame, world.string(step.name or ""), make_location(world, step.location))
        frames.append(frame)
    return world.new_list(frames)


def install(world: World, programs: Any) -> None:
    """The fields ``begin`` and ``end``; errors carry Locations and StackFrames from now on."""
    proto = prototype(world, "Location")

    def write(name: str) -> Any:
        def run(this: Any, value: Any) -> None:
            if not isinstance(value, PositionObject):
                raise world.type_error(1, value, "Position", name)
            setattr(this, name, _copy(world, value))

        return run

    def read(name: str) -> Any:
        return lambda this: _copy(world, getattr(this, name))

    for name in ("begin", "end"):
        field(world, proto, name, read(name), write(name), LocationObject)
    world.location_value = lambda location: make_location(world, location)  # type: ignore[method-assign]
    world.backtrace_value = lambda stack: make_frames(world, stack)  # type: ignore[method-assign]
