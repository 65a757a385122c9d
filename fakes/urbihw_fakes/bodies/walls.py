"""A simulated world as the sensors of a Pioneer know worlds: rays at the height of its sensors, walls, crates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from urbihw_fakes.bodies.simulation import ROBOT_GROUP, SPARE_CRATES, Simulation
from urbihw_fakes.p3dx.world import Pose, Wall, World

SONAR_HEIGHT = 0.19
"""m above the floor, of the middle of the arrays."""
LASER_HEIGHT = 0.32
"""m above the floor, of the plane of the scan."""
_VERTICAL = 0.999
_CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))


class SimulatedWorld(World):
    """A world of MuJoCo with the face of a plane one; ``walls`` are the boxes that nothing moves."""

    def __init__(self, simulation: Simulation, home: Pose) -> None:
        super().__init__(_fixed_walls(simulation), home)
        self._simulation = simulation

    def ray(self, x: float, y: float, angle: float, limit: float) -> float:
        """As in ``World``, at the height of the sonars."""
        return self._cast(x, y, SONAR_HEIGHT, (angle,), limit)[0]

    def rays(self, x: float, y: float, angles: Sequence[float], limit: float) -> list[float]:
        """As in ``World``, at the height of the laser."""
        return self._cast(x, y, LASER_HEIGHT, angles, limit)

    def add_crate(self, x: float, y: float, size: float = 0.4) -> None:
        """As in ``World``; it is as high as it is wide."""
        self._simulation.add_crate(x, y, size)
        super().add_crate(x, y, size)

    def remove_crate(self) -> None:
        super().remove_crate()
        self._simulation.remove_crate()

    def _cast(self, x: float, y: float, height: float, angles: Sequence[float], limit: float) -> list[float]:
        ways = [(math.cos(angle), math.sin(angle), 0.0) for angle in angles]
        return self._simulation.distances((x, y, height), ways, limit)


def _fixed_walls(simulation: Simulation) -> list[Wall]:
    """The outlines of the upright boxes that belong to the world itself."""
    model = simulation.model
    walls: list[Wall] = []
    spare = {model.geom(f"crate{number}").id for number in range(SPARE_CRATES)}
    for geom in range(model.ngeom):
        fixed = model.body_weldid[model.geom_bodyid[geom]] == 0 and geom not in spare
        upright = abs(simulation.data.geom_xmat[geom][8]) > _VERTICAL
        if fixed and upright and _is_box(model, geom) and model.geom_group[geom] != ROBOT_GROUP:
            walls += _outline(simulation, geom)
    return walls


def _is_box(model: Any, geom: int) -> bool:
    return int(model.geom_type[geom]) == 6  # mjGEOM_BOX


def _outline(simulation: Simulation, geom: int) -> list[Wall]:
    x, y, _ = simulation.data.geom_xpos[geom].tolist()
    matrix = simulation.data.geom_xmat[geom].tolist()
    a, b, _ = simulation.model.geom_size[geom].tolist()
    corners = [
        (x + i * a * matrix[0] + j * b * matrix[1], y + i * a * matrix[3] + j * b * matrix[4]) for i, j in _CORNERS
    ]
    return [(*corner, *following) for corner, following in zip(corners, corners[1:] + corners[:1], strict=True)]
