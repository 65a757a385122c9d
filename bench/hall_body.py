"""The hall of the bench of navigation in MuJoCo, and a Pioneer in it, whose wheels slip and whose contacts count."""

from __future__ import annotations

import math
from pathlib import Path

from bench.hall import BOX, START, Hall
from urbihw_fakes.bodies.pioneer import SimulatedBody
from urbihw_fakes.bodies.simulation import ROBOT_GROUP
from urbihw_fakes.p3dx.world import Wall

HEIGHT = 0.6
"""m; higher than all sensors of the robot."""
HALF_THICKNESS = 0.01
"""m, of a wall, whose middle is the line on the map."""


def write_hall(hall: Hall, folder: Path) -> str:
    """Write the hall as MJCF; the path of the file.  The boxes are bodies that the bench moves (mocap)."""
    boxes = "".join(
        f'<body name="box{number}" mocap="true" pos="{x:g} {y:g} {HEIGHT / 2}">'
        f'<geom type="box" size="{BOX / 2} {BOX / 2} {HEIGHT / 2}"/></body>'
        for number, (x, y) in enumerate(each.at for each in hall.boxes)
    )
    walls = "".join(_wall(each) for each in hall.shown)
    path = folder / "hall.xml"
    path.write_text(
        '<mujoco model="hall"><compiler angle="radian"/><worldbody><geom name="floor" type="plane" size="0 0 1"/>'
        f'{walls}{boxes}<site name="start" pos="{START[0]} {START[1]} 0" group="4"/></worldbody></mujoco>', "ascii",
    )  # fmt: skip
    return str(path)


def _wall(wall: Wall) -> str:
    x1, y1, x2, y2 = wall
    half, turned = math.dist((x1, y1), (x2, y2)) / 2, math.atan2(y2 - y1, x2 - x1)
    return (
        f'<geom type="box" pos="{(x1 + x2) / 2:g} {(y1 + y2) / 2:g} {HEIGHT / 2}" euler="0 0 {turned:g}" '
        f'size="{half + HALF_THICKNESS:g} {HALF_THICKNESS} {HEIGHT / 2}"/>'
    )


class HallBody(SimulatedBody):
    """A Pioneer in the hall.

    Attributes:
        contacts: how often it has begun to touch something other than the floor.
    """

    def __init__(self, hall: Hall, folder: Path) -> None:
        self._hall = hall
        self.contacts = 0
        self._touches = False
        super().__init__(write_hall(hall, folder))
        model = self.simulation.model
        self._mocaps = [int(model.body(f"box{number}").mocapid[0]) for number in range(len(hall.boxes))]
        self._floor = int(model.geom("floor").id)

    def _step(self, dt: float) -> None:
        for mocap, each in zip(self._mocaps, self._hall.boxes, strict=True):
            self.simulation.data.mocap_pos[mocap][:2] = each.at
        super()._step(dt)
        touches = self._touches_something()
        self.contacts += touches and not self._touches
        self._touches = touches

    def _touches_something(self) -> bool:
        data, groups = self.simulation.data, self.simulation.model.geom_group
        pairs = (tuple(map(int, contact.geom)) for contact in data.contact[: data.ncon])
        return any(
            self._floor not in pair and ROBOT_GROUP in (groups[pair[0]], groups[pair[1]]) for pair in pairs
        )
