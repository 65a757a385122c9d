"""The urls of simulations.

    mujoco:///home/me/arm.xml       a MuJoCo model or a URDF, by its path
    mujoco://pioneer-wander         one of the bundled worlds (the folder ``worlds``)
    ipc://1234/NAME                 a robot of a Webots on this machine that waits for an extern controller
    tcp://192.168.1.7:1234/NAME     of one elsewhere
    webots://NAME, webots://        of the last Webots that was started on this machine, or the one that started us

NAME is that of the Robot node; it may be left out where only one robot has the controller ``<extern>`` (Webots guide,
"Running extern robot controllers").
"""

from __future__ import annotations

import errno
from collections.abc import Mapping
from pathlib import Path
from typing import Final, Protocol
from urllib.parse import unquote

from urbihw.buses.errors import BadUrl, Unavailable
from urbihw.buses.link import Context, Port, Url
from urbihw.extras import install_command
from urbihw.platforms.scene.library import NoMujoco
from urbihw.platforms.webots import controller_process
from urbihw.platforms.webots.model_check import reason_against
from urbihw.platforms.webots.mujoco_world import BadModel, MujocoWorld
from urbihw.platforms.webots.simulator import Outcome, SimulatedWorld, StepOrder
from urbihw.settings import SettingRule

WORLDS: Final = Path(__file__).with_name("worlds")


class Simulation(Protocol):
    """A simulation as the driver uses it: one step at a time, which may take long."""

    world: SimulatedWorld

    def begin(self, ms: int, orders: list[StepOrder]) -> None:
        """Begin a step of ``ms``, 0 for orders alone; not before the last one has ended."""
        ...

    def poll(self) -> Outcome | None:
        """Return what the step gave, None while it is not over.  Raises LinkGone when the simulator has died."""
        ...

    def close(self) -> None:
        """Leave the simulation for good."""
        ...


class OwnSimulation:
    """A simulation in this thread: a step is over when it has begun."""

    def __init__(self, world: MujocoWorld) -> None:
        self._back_end = world
        self.world = world.world
        self._outcome: Outcome | None = None

    def begin(self, ms: int, orders: list[StepOrder]) -> None:
        self._outcome = self._back_end.run(ms, orders)

    def poll(self) -> Outcome | None:
        outcome, self._outcome = self._outcome, None
        return outcome

    def close(self) -> None:
        self._back_end.close()


class SimulationPort(Port):
    """A port to a simulation; it moves no bytes."""

    simulation: Simulation

    @classmethod
    def parameters(cls, url: Url) -> Mapping[str, SettingRule]:
        """An empty table: such a url has no parameters."""
        return {}

    def _close(self) -> None:
        self.simulation.close()


class MujocoPort(SimulationPort):
    """``mujoco://``"""

    def _open(self) -> None:
        path = model_path(self.url.target)
        if not path.is_file():
            raise Unavailable(errno.ENOENT, f"{self.url.text}: {_no_file(path)}")
        try:
            if path.parent != WORLDS and (reason := reason_against(path)):
                raise BadModel(reason)
            self.simulation = OwnSimulation(MujocoWorld(path))
        except NoMujoco as error:
            raise Unavailable(errno.ENOPKG, f"mujoco:// needs the Python package {error}: "
                              f"{install_command('mujoco')}") from error
        except BadModel as error:
            raise Unavailable(errno.EINVAL, f"the model cannot be loaded: {error}") from error


class WebotsPort(SimulationPort):
    """``ipc://``, ``tcp://`` and ``webots://``"""

    def __init__(self, url: Url, context: Context) -> None:
        super().__init__(url, context)
        if url.scheme == "tcp" and ":" not in url.target:
            raise BadUrl(f"bus url {url.text!r}: write tcp://address:port or tcp://address:port/robot")

    def _open(self) -> None:
        url = unquote(self.url.target) if self.url.scheme == "webots" else self.url.text
        self.simulation = controller_process.ControllerProcess(url)


def model_path(target: str) -> Path:
    """Return the file of a ``mujoco://`` url: a path, or the name of a bundled world."""
    if "/" in target or target.endswith((".xml", ".urdf")):
        return Path(target)
    return WORLDS / f"{target}.xml"


def bundled_worlds() -> list[str]:
    """Return the names of the bundled worlds."""
    return sorted(path.stem for path in WORLDS.glob("*.xml"))


def _no_file(path: Path) -> str:
    if path.parent == WORLDS:
        return f"there is no world {path.stem!r}; there are: {', '.join(bundled_worlds())}; or write mujoco:///PATH"
    return f"there is no file {path}"
