"""Location and StackFrame: the source range of an error, and the calls that led to it."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.location import LocationObject, PositionObject, copy_position, make_position
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.support import field
from urbihw.kernel.value import Value

LOCATION = Table("Location")
FRAME = Table("StackFrame")
TABLES = (LOCATION, FRAME)

NOTES = {
    "Location": "A range of a source text, from one Position to another.",
    "StackFrame": "One call of a call stack.",
    "Location.begin": "The Position of the first character; can be assigned.",
    "Location.end": "The Position after the last character; can be assigned.",
    "StackFrame.name": "The name of the called function.",
    "StackFrame.location": "The Location of the call.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


CLASSES = {"Location": LocationObject}


@LOCATION.primitive("init")
def init(world: World, this: LocationObject, begin: Value = None, end: Value = None) -> None:
    """Make a Location from one Position or from two; 1.1 without arguments."""
    for index, position in enumerate((begin, end), 1):
        if position is not None and not isinstance(position, PositionObject):
            raise world.type_error(index, position, "Position")
    this.begin = make_position(world, 1, 1, None) if begin is None else copy_position(world, begin)
    this.end = copy_position(world, this.begin if end is None else end)


@LOCATION.primitive("asString")
def as_string(world: World, this: LocationObject) -> str:
    """``file:line.column-line.column``, in the shortest form."""
    return this.text()


@LOCATION.primitive("==")
def equal(world: World, this: LocationObject, that: Value) -> bool:
    """Whether both have the same begin and end."""
    return isinstance(that, LocationObject) and _places(this) == _places(that)


def _places(this: LocationObject) -> tuple[int, ...]:
    return this.begin.line, this.begin.column, this.end.line, this.end.column


@FRAME.primitive("init")
def init_frame(world: World, this: Obj, name: Value, location: Any) -> None:
    """Make a StackFrame from the name of the called function and the Location of the call."""
    this.slots["name"] = name
    this.slots["location"] = location


@FRAME.primitive("asString")
def frame_string(world: World, this: Obj) -> str:
    """``location: name``."""
    if "name" not in this.slots:
        return "StackFrame"
    return f"{world.text(this.slots['location'])}: {world.text(this.slots['name'])}"


def install(world: World, programs: Any) -> None:
    """Make the fields ``begin`` and ``end``."""
    proto = prototype(world, "Location")

    def write(name: str) -> Any:
        def run(this: Value, value: Value) -> None:
            if not isinstance(value, PositionObject):
                raise world.type_error(1, value, "Position", name)
            setattr(this, name, copy_position(world, value))

        return run

    def read(name: str) -> Any:
        return lambda this: copy_position(world, getattr(this, name))

    for name in ("begin", "end"):
        field(world, proto, name, read(name), write(name), LocationObject)
