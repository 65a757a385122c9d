"""What a simulation is to the driver: devices by name, orders, steps, and samples.  No I/O.

A back end derives from ``BackEnd``.  All its methods are called by one thread.  Sensors follow the rules of Webots
(reference manual, "Sensors", "wb_robot_step"): one gives nothing until it is enabled with a sampling period, its first
value comes one period later, and between two samples the last one holds; orders act with the next step.

Units are SI: rad, m, s, N m, m/s2.
"""

from __future__ import annotations

import difflib
import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import field
from typing import Any, Final, NamedTuple

from urbihw.frozen import frozen

MOTOR: Final = "motor"
POSITION_SENSOR: Final = "position sensor"
ACCELEROMETER: Final = "accelerometer"
GYRO: Final = "gyro"
COMPASS: Final = "compass"
GPS: Final = "GPS"
INERTIAL_UNIT: Final = "inertial unit"
DISTANCE_SENSOR: Final = "distance sensor"
TOUCH_SENSOR: Final = "touch sensor"
LIGHT_SENSOR: Final = "light sensor"
CAMERA: Final = "camera"
RANGE_FINDER: Final = "range finder"
LIDAR: Final = "lidar"
LED: Final = "LED"
EMITTER: Final = "emitter"
RECEIVER: Final = "receiver"
SPEAKER: Final = "speaker"
DISPLAY: Final = "display"
NODE: Final = "node"
NODES: Final = "node "
"""Prefix of a part of the world that a supervisor moves: it is sampled like a device, as x, y, z and a rotation
vector."""
SCENE: Final = "scene"
"""Sampled like a device where the simulation can be looked at: its state (``urbihw.platforms.scene.state``)."""

REVERTED: Final = "the world was reloaded"
QUIT: Final = "the simulation was ended by its program"


@frozen(slots=False)
class SimDevice:
    """A device of the simulated robot: its name, its kind (above), and numbers that do not change, by name."""

    name: str
    kind: str
    facts: Mapping[str, float] = field(default_factory=dict)


@frozen(slots=False)
class SimulatedWorld:
    """What is known of a simulation when it is there.

    Attributes:
        name: of the robot, or of the model.
        simulator: which program simulates, with its version.
        step_ms: the basic time step, in milliseconds; all steps and periods are multiples of it.
        devices: of the robot.
        nodes: what ``ManipulateNode`` may move; None if the simulator does not list it.
        supervisor: whether the robot may change the world.
        folder: of the model file, "" if there is none.
        program: the binding files of the model, relative to ``folder``, with blanks between them; "" for none.
        model: the file of the model, to look at it; "" where the simulator shows it by itself.
    """

    name: str
    simulator: str
    step_ms: int
    devices: tuple[SimDevice, ...]
    nodes: tuple[str, ...] | None = None
    supervisor: bool = True
    folder: str = ""
    program: str = ""
    model: str = ""

    def device(self, name: str, kind: str) -> SimDevice:
        """Return a device by name and kind.  Raises ValueError, which names those that there are."""
        found = next((each for each in self.devices if each.name == name), None)
        if found is None:
            raise ValueError(no_such(kind, name, [each.name for each in self.devices if each.kind == kind]))
        if found.kind != kind:
            raise ValueError(f"{name!r} is no {kind}: it is of the kind {found.kind!r}")
        return found


def no_such(kind: str, name: str, known: Collection[str]) -> str:
    """Return the words for a name that nothing has, with those that there are."""
    if not known:
        return f"no {kind} {name!r}: the robot has none"
    close = difflib.get_close_matches(name, known, 1)
    guess = f"; did you mean {close[0]!r}?" if close else ""
    return f"no {kind} {name!r}{guess}; there are: {', '.join(sorted(known))}"


class StepOrder(NamedTuple):
    """Something to do before the next step.

    ``verb`` is "enable" (``value``: period in ms, 0 to disable), "write" (an item of a device), "stop" (a motor),
    "move" (``item`` "translation" or "rotation" of a node, three numbers), "label" (``value``: a ``Label``), "reset
    physics", "revert" or "quit".
    """

    verb: str
    device: str = ""
    item: str = ""
    value: Any = None


class LabelText(NamedTuple):
    """A text over the view of the world: x, y and size are shares of it, colours and opacity go from 0 to 1."""

    number: int
    text: str
    x: float
    y: float
    size: float
    red: float
    green: float
    blue: float
    opacity: float


@frozen(slots=False)
class Outcome:
    """What a step gives.

    Attributes:
        time: of the simulation, in seconds.
        samples: device -> value, of those that were due.
        problems: orders that could not be executed, one line each.
        ended: why the controller must end now (the simulator reloads the world, or quits); "" if it need not.
    """

    time: float
    samples: Mapping[str, Any]
    problems: tuple[str, ...] = ()
    ended: str = ""


class BackEnd(ABC):
    """A simulation; the base does the sampling."""

    world: SimulatedWorld

    def __init__(self) -> None:
        self.elapsed_ms = 0
        self._periods: dict[str, int] = {}
        self._due: dict[str, int] = {}

    def run(self, ms: int, orders: Sequence[StepOrder]) -> Outcome:
        """Execute orders, then let the simulation go on by ``ms``; 0 for not at all."""
        problems: list[str] = []
        ended = ""
        for order in orders:
            try:
                ended = self._execute(order) or ended
            except ValueError as error:
                problems.append(str(error))
        if ms and not ended:
            if self.step(ms):
                self.elapsed_ms += ms
            else:
                ended = REVERTED
        samples: dict[str, Any] = {}
        if not ended:
            for name in [name for name, due in self._due.items() if due <= self.elapsed_ms]:
                self._due[name] += self._periods[name]
                self._sample(name, samples, problems)
        return Outcome(self.time(), samples, tuple(problems), ended)

    def _sample(self, name: str, samples: dict[str, Any], problems: list[str]) -> None:
        try:
            samples[name] = self.read(name)
        except ValueError as error:
            # Once: a camera without OpenGL has none in the next period either.
            del self._due[name], self._periods[name]
            problems.append(str(error))

    def _execute(self, order: StepOrder) -> str:
        match order.verb:
            case "enable":
                self._enable(order.device, int(order.value))
            case "write":
                self.write(order.device, order.item, order.value)
            case "stop":
                self.stop(order.device)
            case "move":
                self.move(order.device, order.item, order.value)
            case "label":
                self.label(order.value)
            case "reset physics":
                self.reset_physics()
            case "revert":
                self.revert()
                return REVERTED
            case "quit":
                self.quit()
                return QUIT
        return ""

    def _enable(self, name: str, period: int) -> None:
        step = self.world.step_ms
        period = max(1, math.ceil(period / step)) * step if period else 0
        self.enable(name, period)
        if period:
            if self._periods.get(name) != period:
                self._periods[name] = period
                self._due[name] = self.elapsed_ms + period
        else:
            self._periods.pop(name, None)
            self._due.pop(name, None)

    @abstractmethod
    def step(self, ms: int) -> bool:
        """Let the simulation go on; False when the controller must end."""

    @abstractmethod
    def time(self) -> float:
        """Return the time of the simulation, in seconds."""

    @abstractmethod
    def enable(self, name: str, period: int) -> None:
        """Begin to sample a device, or a node (NODES + its name), every ``period`` ms, 0 to end it.

        Raises ValueError for an unknown one.
        """

    @abstractmethod
    def read(self, name: str) -> Any:
        """Return the last sample of a device that is due.

        A number, numbers (of a motor: position, speed, torque, nan for what is not measured), or bytes of an rgb
        image.  Raises ValueError when it cannot be had.
        """

    @abstractmethod
    def write(self, name: str, item: str, value: Any) -> None:
        """Write to a device.  Raises ValueError.

        A motor has "position" (inf: turn by speed), "velocity", "torque", "max velocity"; an LED "value"; an emitter
        "packet"; a speaker "sound"; a display "image".
        """

    @abstractmethod
    def stop(self, name: str) -> None:
        """Let a motor hold its position, or turn no more."""

    @abstractmethod
    def move(self, node: str, item: str, value: Sequence[float]) -> None:
        """Put a node somewhere.  Raises ValueError."""

    @abstractmethod
    def label(self, label: LabelText) -> None:
        """Show a text over the view, where there is one; an empty one removes it."""

    @abstractmethod
    def reset_physics(self) -> None:
        """Stop all bodies where they are."""

    @abstractmethod
    def revert(self) -> None:
        """Reload the world.  Raises ValueError when that cannot be."""

    @abstractmethod
    def quit(self) -> None:
        """End the simulator itself, for all its robots."""

    @abstractmethod
    def close(self) -> None:
        """Leave the simulation for good."""
