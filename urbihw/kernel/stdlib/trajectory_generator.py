"""TrajectoryGenerator: the classes behind ``x = 10 time: 1s``, for programs that make movements explicitly.

Source: manual, specs/trajectory-generator, for the names and the hierarchy; ``runtime.trajectory`` has the mechanism.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.trajectory import Trajectory
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.members import callable_of

TABLE = Table("TrajectoryGenerator")
KINDS = {
    "OpenLoop": ("", {}),
    "ClosedLoop": ("", {}),
    "Accel": ("OpenLoop", {"accel": 0.0}),
    "Sin": ("OpenLoop", {"sin": 0.0}),
    "Smooth": ("OpenLoop", {"smooth": 0.0}),
    "Time": ("OpenLoop", {"time": 0.0}),
    "SpeedAdaptive": ("ClosedLoop", {"speed": 0.0, "adaptive": True}),
    "TimeAdaptive": ("ClosedLoop", {"time": 0.0, "adaptive": True}),
}
"""Class -> its base class and the attributes of its movements; the first attribute is the parameter."""

PROTOS = {
    f"TrajectoryGenerator.{name}": (f"TrajectoryGenerator.{parent}" if parent else "TrajectoryGenerator",)
    for name, (parent, _) in KINDS.items()
}

NOTES = {
    "TrajectoryGenerator.Accel": "A movement with constant acceleration.",
    "TrajectoryGenerator.Sin": "An endless sine wave.",
    "TrajectoryGenerator.Smooth": "A movement with a soft start and a soft end.",
    "TrajectoryGenerator.SpeedAdaptive": "A movement with constant speed that adapts to the present value.",
    "TrajectoryGenerator.Time": "A movement with constant speed and a given duration.",
    "TrajectoryGenerator.TimeAdaptive": "A movement with a given duration that adapts to the present value.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class GeneratorObject(Obj):
    """An urbiscript TrajectoryGenerator, with its attributes."""

    __slots__ = ("attributes", "getter", "setter", "target")

    def __init__(self, world: World, protos: list[Obj], attributes: dict[str, Any] | None = None) -> None:
        super().__init__(world, protos)
        self.attributes = attributes if attributes is not None else {}
        self.getter: Any = None
        self.setter: Any = None
        self.target: Any = 0.0

    def clone(self) -> GeneratorObject:
        """A generator of the same movement."""
        made = GeneratorObject(self.world, [self], dict(self.attributes))
        made.getter, made.setter, made.target = self.getter, self.setter, self.target
        return made


def _maker(attributes: dict[str, Any]) -> Any:
    return lambda world, protos: GeneratorObject(world, protos, dict(attributes))


CLASSES = {"TrajectoryGenerator": GeneratorObject} | {
    f"TrajectoryGenerator.{name}": _maker(attributes) for name, (_, attributes) in KINDS.items()
}


@TABLE.primitive("init")
def init(
    world: World,
    this: GeneratorObject,
    getter: Any,
    setter: Any,
    target: float,
    parameter: float,
    amplitude: float = 0.0,
) -> None:
    """Make a movement to ``target``; ``getter()`` reads the present value and ``setter(v)`` writes it.  The parameter
    is a time in seconds, a speed in units per second or an acceleration, depending on the class; a sine has an
    amplitude too."""
    this.getter, this.setter = callable_of(world, getter, 1), callable_of(world, setter, 2)
    this.target = target
    if this.attributes:
        this.attributes[next(iter(this.attributes))] = parameter
    if "sin" in this.attributes:
        this.attributes["ampli"] = amplitude


@TABLE.primitive("run")
def run(world: World, this: GeneratorObject) -> None:
    """Run the movement until the target is reached; a sine does not end."""
    Trajectory(
        world,
        lambda: world.invoke(this.getter, this),
        lambda value: world.invoke(this.setter, this, (value,)),
        this.target,
        this.attributes,
    ).run()
