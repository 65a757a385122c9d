"""A robot's model in a world, stepped by the clock of its fake: all that is said to MuJoCo goes through here.

Units are SI.  The geoms of a robot are in group ``ROBOT_GROUP``, so that its own rays pass through it.  Time comes as
an argument: the same calls give the same motion.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from urbihw_fakes.errors import UnknownRequest

ROBOT_GROUP = 2
PREFIX = "robot/"
SPARE_CRATES = 8
"""How many crates can be put into a world while it runs."""
_PARKED = (0.0, 0.0, 50.0)
"""Where those wait that are not there."""
_HERE = Path(__file__).parent


def world_names() -> list[str]:
    """The names of the worlds there are."""
    return sorted(path.stem for path in (_HERE / "worlds").glob("*.xml"))


def is_simulated(world: str) -> bool:
    """Whether a ``--world`` means a world in MuJoCo: one of ``world_names``, or a file of MJCF (``.xml``)."""
    return world in world_names() or world.endswith(".xml")


def unknown_world(world: str, other: str) -> UnknownRequest:
    """The error for a name that is no world; ``other`` is what it could be besides."""
    return UnknownRequest(f"--world {world}: the worlds are {' and '.join(world_names())}, or {other}")


class Simulation:
    """The model of one robot in one world.

    Attributes:
        model, data: those of MuJoCo.
    """

    def __init__(self, robot: str, world: str, step: float) -> None:
        """``robot`` is a file of ``models``; ``world`` a name or the path of a file; ``step`` the s of a step.

        The robot stands at the site ``start_ROBOT`` of the world, else at ``start``, else in the middle.

        Raises:
            UnknownRequest: mujoco is not installed, or there is no such world, or it is no model.
        """
        self._mujoco = mujoco = _library()
        self.model, self.data = _compose(mujoco, robot, _world_file(world), world, step)
        self._rays = _Rays(mujoco, self.model, self.data)
        self._crates: list[int] = []
        mujoco.mj_forward(self.model, self.data)

    @property
    def time(self) -> float:
        """Simulated s since the start."""
        return float(self.data.time)

    def step(self, count: int = 1) -> None:
        """Let ``count`` steps pass."""
        self._mujoco.mj_step(self.model, self.data, count)

    def save_model(self, path: str) -> None:
        """Write the model to a file (.mjb).

        Raises:
            UnknownRequest: it cannot be written.
        """
        try:
            self._mujoco.mj_saveModel(self.model, path)
        except Exception as error:
            raise UnknownRequest(f"scene: {path} cannot be written: {' '.join(str(error).split())}") from None
        if not Path(path).is_file():
            raise UnknownRequest(f"scene: {path} cannot be written")

    def forward(self) -> None:
        """Bring all that follows from the positions up to date, after they were set by hand."""
        self._mujoco.mj_forward(self.model, self.data)

    def body(self, name: str) -> int:
        """The number of a body of the robot."""
        return int(self.model.body(PREFIX + name).id)

    def geom(self, name: str) -> int:
        """The number of a geom of the robot."""
        return int(self.model.geom(PREFIX + name).id)

    def actuator(self, name: str) -> int:
        """The number of an actuator of the robot."""
        return int(self.model.actuator(PREFIX + name).id)

    def joint(self, name: str) -> tuple[int, int]:
        """Where the position and the velocity of a joint of the robot are, in ``qpos`` and ``qvel``."""
        joint = self.model.joint(PREFIX + name)
        return int(joint.qposadr[0]), int(joint.dofadr[0])

    def site(self, name: str) -> int:
        """The number of a site of the robot."""
        return int(self.model.site(PREFIX + name).id)

    def sensor(self, name: str) -> slice:
        """Where the values of a sensor of the robot are, in ``sensordata``."""
        sensor = self.model.sensor(PREFIX + name)
        return slice(int(sensor.adr[0]), int(sensor.adr[0] + sensor.dim[0]))

    def place_in_world(self, site: str) -> tuple[float, float] | None:
        """Where a site of the world is on the plane: m; None if it has none of this name."""
        number = self._mujoco.mj_name2id(self.model, self._mujoco.mjtObj.mjOBJ_SITE, site)
        if number < 0:
            return None
        x, y, _ = self.data.site_xpos[number].tolist()
        return x, y

    def reset(self) -> None:
        """Everything as at the start, but for the time and the crates."""
        time, crates = float(self.data.time), self.data.mocap_pos.copy()
        self._mujoco.mj_resetData(self.model, self.data)
        self.data.time, self.data.mocap_pos[:] = time, crates
        self.forward()

    def put_on_feet(self, base: str, soles: Sequence[str], start: tuple[float, float, float]) -> None:
        """Turn the robot so that its soles are level, and lower it until the lowest touches the floor.

        ``base`` is the body (and joint) that all hangs on; ``start`` its x, y and heading.
        """
        data, mujoco = self.data, self._mujoco
        place, _ = self.joint(base)
        x, y, heading = start
        data.qpos[place : place + 7] = (x, y, 0.0, 1.0, 0.0, 0.0, 0.0)
        self.forward()
        quaternion = data.qpos[place + 3 : place + 7]
        heading_only = quaternion.copy()
        heading_only[:] = (math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2))
        mujoco.mju_mat2Quat(quaternion, data.geom_xmat[self.geom(soles[0])])
        mujoco.mju_negQuat(quaternion, quaternion.copy())
        mujoco.mju_mulQuat(quaternion, heading_only, quaternion.copy())
        self.forward()
        data.qpos[place + 2] = -min(self._bottom(self.geom(name)) for name in soles)
        self.forward()

    def _bottom(self, geom: int) -> float:
        """How high the lowest corner of a box is: m."""
        sizes, upwards = self.model.geom_size[geom], self.data.geom_xmat[geom][6:]
        down = sum(abs(float(size * up)) for size, up in zip(sizes, upwards, strict=True))
        return float(self.data.geom_xpos[geom][2]) - down

    def pose(self, body: int) -> tuple[float, float, float]:
        """Where a body is on the plane: x, y and heading (m, m, rad)."""
        x, y, _ = self.data.xpos[body]
        matrix = self.data.xmat[body]
        return float(x), float(y), math.atan2(matrix[3], matrix[0])

    def tilt(self, body: int) -> float:
        """How far a body leans from upright: rad."""
        return math.acos(max(-1.0, min(1.0, float(self.data.xmat[body][8]))))

    def lean(self, body: int) -> tuple[float, float]:
        """How far a body leans forward and to its left: rad."""
        matrix = self.data.xmat[body]
        return math.atan2(-float(matrix[6]), float(matrix[8])), math.atan2(-float(matrix[7]), float(matrix[8]))

    def touched(self, geoms: frozenset[int]) -> set[int]:
        """The geoms among these that touch something."""
        found: set[int] = set()
        for contact in self.data.contact[: self.data.ncon]:
            found.update(geoms.intersection(int(geom) for geom in contact.geom))
        return found

    def distances(self, origin: Sequence[float], ways: Sequence[Sequence[float]], limit: float) -> list[float]:
        """How far it is from a point along each of these directions (unit vectors) to something that is not the robot:
        m, at most ``limit``."""
        return self._rays.cast(origin, ways, limit)

    # --- crates ---------------------------------------------------------------------------------------------------

    @property
    def crates(self) -> int:
        """How many crates have been put into the world."""
        return len(self._crates)

    def add_crate(self, x: float, y: float, size: float = 0.4) -> None:
        """Put a crate that nothing moves into the world; its middle at x, y.

        Raises:
            UnknownRequest: there are ``SPARE_CRATES`` already.
        """
        if len(self._crates) == SPARE_CRATES:
            raise UnknownRequest(f"box: a simulated world has room for {SPARE_CRATES} crates; take one away (unbox)")
        number, half = len(self._crates), size / 2
        geom = int(self.model.geom(f"crate{number}").id)
        self.model.geom_size[geom] = (half, half, half)
        self.model.geom_aabb[geom][3:] = half
        self.model.geom_rbound[geom] = half * math.sqrt(3)
        # The box around its body, by which a body of several geoms differs from it.
        self.model.bvh_aabb[self.model.body_bvhadr[self.model.geom_bodyid[geom]], 3:] = half
        self._place_crate(number, (x, y, half))
        self._crates.append(geom)

    def remove_crate(self) -> None:
        """Take the last crate away again."""
        self._crates.pop()
        self._place_crate(len(self._crates), _PARKED)

    def _place_crate(self, number: int, place: tuple[float, float, float]) -> None:
        self.data.mocap_pos[int(self.model.body(f"crate{number}").mocapid[0])] = place
        self.forward()


class _Rays:
    """What lies along rays through the world, past the robot."""

    def __init__(self, mujoco: Any, model: Any, data: Any) -> None:
        import numpy

        self._mujoco, self._numpy = mujoco, numpy
        self._model, self._data = model, data
        self._groups = numpy.ones(mujoco.mjNGROUP, numpy.uint8)
        self._groups[ROBOT_GROUP] = 0

    def cast(self, origin: Sequence[float], ways: Sequence[Sequence[float]], limit: float) -> list[float]:
        numpy, count = self._numpy, len(ways)
        found = numpy.empty(count)
        self._mujoco.mj_multiRay(
            self._model, self._data, numpy.asarray(origin, float), numpy.asarray(ways, float).ravel(), self._groups,
            True, -1, numpy.empty(count, numpy.int32), found, None, count, limit,
        )  # fmt: skip
        # -1 is "nothing there".
        return [limit if metres < 0 or metres > limit else metres for metres in found.tolist()]


def _library() -> Any:
    try:
        import mujoco
    except ImportError:
        raise UnknownRequest(
            f"--world: the package mujoco is not installed: {sys.prefix}/bin/pip install 'mujoco>=4,<5'"
        ) from None
    except Exception as error:  # a wrong MUJOCO_GL, or a library of the system that it lacks
        text = " ".join(str(error).split())
        raise UnknownRequest(f"--world: the package mujoco cannot be loaded (see MUJOCO_GL): {text}") from None
    return mujoco


def _world_file(world: str) -> Path:
    if world in world_names():
        return _HERE / "worlds" / f"{world}.xml"
    if not world.endswith(".xml"):
        raise unknown_world(world, "a file of MJCF (.xml)")
    return Path(world)


def _compose(mujoco: Any, robot: str, file: Path, name: str, step: float) -> tuple[Any, Any]:
    """The robot at its start in the world, with spare crates: MuJoCo's model and data."""
    own = mujoco.MjSpec.from_file(str(_HERE / "models" / f"{robot}.xml"))
    if not file.is_file():
        raise UnknownRequest(f"--world {name}: there is no such file")
    try:
        spec = mujoco.MjSpec.from_file(str(file))
        start = spec.site(f"start_{robot}") or spec.site("start") or spec.worldbody.add_site()
        spec.attach(own, site=start, prefix=PREFIX)
        for number in range(SPARE_CRATES):
            crate = spec.worldbody.add_body(name=f"crate{number}", mocap=True, pos=_PARKED)
            crate.add_geom(name=f"crate{number}", type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.1, 0.1, 0.1),
                           rgba=(0.6, 0.45, 0.3, 1))  # fmt: skip
        spec.option.timestep = step
        # The implicit ones damp a driven wheel without its contact: it would turn less than it rolls.
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        model = spec.compile()
    except ValueError as error:
        raise UnknownRequest(f"--world {name}: {' '.join(str(error).split())}") from None
    return model, mujoco.MjData(model)
