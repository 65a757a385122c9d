"""TrajectoryGenerator: the classes behind ``x = 10 time: 1s``, for programs that make movements by hand.

Source: manual, specs/trajectory-generator, for the names and what derives from what; the mechanism is
``runtime.trajectory``.
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
"""Class -> the class it derives from and the attributes of its movements; the first one is the parameter."""

PROTOS = {
    f"TrajectoryGenerator.{name}": (f"TrajectoryGenerator.{parent}" if parent else "TrajectoryGenerator",)
    for name, (parent, _) in KINDS.items()
}

NOTES = {
    "TrajectoryGenerator.Accel": "A movement of constant acceleration.",
    "TrajectoryGenerator.Sin": "A sine wave, without end.",
    "TrajectoryGenerator.Smooth": "A movement that begins and ends softly.",
    "TrajectoryGenerator.SpeedAdaptive": "A movement of constant speed from wherever the value is.",
    "TrajectoryGenerator.Time": "A movement of constant speed that takes a given time.",
    "TrajectoryGenerator.TimeAdaptive": "A movement that takes a given time from wherever the value is.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class GeneratorObject(Obj):
    """An urbiscript TrajectoryGenerator."""

    __slots__ = ("attributes", "getter", "setter", "target")

    def __init__(self, world: World, protos: list[Obj], attributes: dict[str, Any] | None = None) -> None:
        super().__init__(world, protos)
        self.attributes = attributes if attributes is not None else {}
        self.getter: Any = None
        self.setter: Any = None
        self.target: Any = 0.0

    def clone(self) -> GeneratorObject:
        """A movement of the same kind."""
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
    """A movement to ``target`` of what ``getter()`` reads and ``setter(v)`` writes; the parameter is a time in seconds,
    a speed in units a second or an acceleration, by the class; a sine has an amplitude too."""
    this.getter, this.setter = callable_of(world, getter, 1), callable_of(world, setter, 2)
    this.target = target
    if this.attributes:
        this.attributes[next(iter(this.attributes))] = parameter
    if "sin" in this.attributes:
        this.attributes["ampli"] = amplitude


@TABLE.primitive("run")
def run(world: World, this: GeneratorObject) -> None:
    """Move; over when the target is reached (never, for a sine)."""
    Trajectory(
        world,
        lambda: world.invoke(this.getter, this),
        lambda value: world.invoke(this.setter, this, (value,)),
        this.target,
        this.attributes,
    ).run()
