"""A simulated world of MuJoCo in simulated time: see ``lab``.  Without the package mujoco its tests are skipped."""

from __future__ import annotations

import errno
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import pytest
from lab import RobotLab
from motions import Kind, Motion, Numbers
from slot_units import BUS, GAINS, MOBILE, PICTURE, UnitTable

from urbihw.buses.errors import LinkGone, Unavailable
from urbihw.buses.link import Context
from urbihw.platforms.webots import port as ports
from urbihw.platforms.webots.mujoco_world import MujocoWorld
from urbihw_fakes.console import Console

_open_for_good = ports.MujocoPort._open


def need_mujoco() -> None:
    """Skip the test where the package is not installed; it is imported by the product, which says how it renders."""
    if importlib.util.find_spec("mujoco") is None:
        pytest.skip("the package mujoco is not installed")


class Plug:
    """A world that goes on without a connection, as one of Webots does; it can be cut off."""

    def __init__(self) -> None:
        self.world: MujocoWorld | None = None
        self.plugged = True

    @property
    def faults(self) -> Plug:
        """The faults of a fake, which a simulation has not: all of them cut it off for a while, or do nothing."""
        return self

    def __iter__(self) -> Iterator[str]:
        """The present faults."""
        return iter(() if self.plugged else ("cut off",))

    def unplug(self) -> None:
        """Cut it off."""
        self.plugged = False

    def replug(self) -> None:
        """Let it be reached again."""
        self.plugged = True

    def start(self, word: str, unit: Any = None, times: int = 0) -> None:
        """A fault begins."""
        if word == "silence":
            self.plugged = False

    def stop(self, word: str, unit: Any = None) -> None:
        """A fault ends."""
        self.plugged = True

    def power_off(self, now: float, unit: Any = None) -> None:
        """It is cut off."""
        self.plugged = False

    def power_on(self, now: float, unit: Any = None) -> None:
        """It answers again."""
        self.plugged = True

    def send(self, data: bytes, at: float) -> None:
        """Garbage on a wire that there is not."""

    def open(self, port: ports.MujocoPort) -> None:
        """Take the place of opening the model."""
        if not self.plugged:
            raise Unavailable(errno.EHOSTUNREACH, "the simulator does not answer")
        if self.world is None:
            _open_for_good(port)
            self.world = port.simulation._back_end  # type: ignore[attr-defined]
        else:
            port.simulation = ports.OwnSimulation(self.world)
        poll = port.simulation.poll

        def checked() -> Any:
            if not self.plugged:
                raise LinkGone("the simulator does not answer")
            return poll()

        port.simulation.poll = checked  # type: ignore[method-assign]


def _open(self: ports.MujocoPort) -> None:
    plug: Any = self.context.pipes.get("world")
    if plug is None:
        _open_for_good(self)
    else:
        plug.open(self)


ports.MujocoPort._open = _open  # type: ignore[method-assign]


class Lab(RobotLab):
    """A world, and a robot in it."""

    platform = "webots"
    url = "mujoco://pioneer-wander"
    tick = 0.02

    def __init__(self, path: Path | None = None, **options: Any) -> None:
        need_mujoco()
        self.plug = Plug()
        if path is not None:
            self.url = f"mujoco://{path}"  # type: ignore[misc]
        self._places: dict[str, tuple[float, float]] = {}
        super().__init__(**options)

    def context(self) -> Context:
        plug: Any = {"world": self.plug}
        return Context(self.bus_clock, plug)

    def console(self) -> Console:
        """A world has no console."""
        cable: Any = SimpleNamespace(device=SimpleNamespace(numbers=tuple), clock=self.bus_clock.now)
        return Console(cable, {})

    @property
    def world(self) -> Any:
        """The back end with its ``_model`` and ``_data``: the body."""
        return self.plug.world

    def body(self, name: str) -> Any:
        """A body of the physics (``xpos``, ``xquat``)."""
        return self.world._data.body(name)

    def joint(self, name: str) -> float:
        """The angle of a joint in the physics, in rad; 0 before there is any."""
        return 0.0 if self.world is None else float(self.world._data.joint(name).qpos[0])

    def turned(self, name: str) -> float:
        """How fast a joint has turned since the last look, in rad/s: a world that stands still turns nothing."""
        place, now = self.joint(name), self.bus_clock.now()
        before, at = self._places.get(name, (place, now - 1.0))
        self._places[name] = place, now
        return (place - before) / max(now - at, self.tick)


_WHEELS = ("left wheel", "right wheel")


def _body(lab: Lab) -> tuple[Numbers, Numbers]:
    return tuple(map(lab.turned, _WHEELS)), tuple(map(lab.joint, _WHEELS))


def _plug(lab: Lab, plugged: bool) -> None:
    lab.plug.plugged = plugged


MOTION = Motion(
    make=Lab.ready,
    look=_body,
    slot="webots",
    unplug=lambda lab: _plug(lab, False),
    plug=lambda lab: _plug(lab, True),
    standstill=0.4,
    alone="a simulator lets one controller move the motors of a robot",
    kinds={
        "speed": Kind("wheelL.speed = 3;", 2.5),
        "angle": Kind("wheelL.angle = 30;", 2.0),
        "trajectory": Kind("wheelL.speed = 0 sin:2s ampli:3,", 2.0, lead=2.3, live=True),
        "at": Kind(
            "trip!;", 2.0, lead=1.5, live=True,
            prepare='if (!Global.hasLocalSlot("trip")) var Global.trip = Event.new|;'
            " at (trip?) loop { wheelL.speed = 3; sleep(200ms); wheelL.speed = -3; sleep(400ms) };",
        ),
        "go": Kind("robot.go(2);", 1.5, error=True),
        "turn by an angle": Kind("robot.turn(20);", 0.6, error=True),
        "remote": Kind("wheelL.speed = 3", 2.5, remote=True),
    },
)  # fmt: skip


UNITS: Final[UnitTable] = {  # chapter "Webots": the devices of pioneer-wander
    "Webots": BUS | {"s": "time step", "1": "epoch stops factor"},
    "DifferentialWheels": {
        "rad": "angle val requested applied", "rad/s": "speed maxSpeed", "turn": "turn", "N m": "torque",
        "1": f"load encoder encoderResolution {GAINS}",
    },
    "DistanceSensor": {"m": "distance val", "1": "load factor"},
    "TouchSensor": {"1": "pressure val load"},
    "Gyro": {"rad/s": "speed val", "1": "load"},
    "GPS": {"m": "x y z val", "1": "load"},
    "InertialUnit": {"rad": "roll pitch yaw val", "1": "load"},
    "Lidar": {
        "m": "val distanceMin distanceMax", "rad": "angleMin angleMax resolution", "Hz": "rate", "1": "load",
    },
    "Camera": PICTURE | {"rad": "xfov yfov", "m": "near far", "1": "load gain wb quality resolution"},
    "WorldView": PICTURE | {"rad": "azimuth elevation xfov yfov", "m": "distance",
                             "1": "frames gain wb quality resolution"},
    "robot": MOBILE,
}  # fmt: skip
