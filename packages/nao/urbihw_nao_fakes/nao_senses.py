"""What a Nao feels and hears in a world: inertial unit, force under the feet, bumpers, sonars."""

from __future__ import annotations

import math

from urbihw_fakes.bodies.simulation import Simulation
from urbihw_nao_fakes.body import Feeling

GRAVITY = 9.81
SONAR_RANGE = 2.55
"""m; nothing is heard beyond (the maker's page "Sonars", V4)."""
SONARS = {"sonar_left": 1.0, "sonar_right": -1.0}
_CONE = [(math.radians(yaw), math.radians(pitch)) for yaw in (-10, 5, 20, 35, 50) for pitch in (0, 15)]
"""Ways that a sonar hears, outwards and up: rad; its cone is 60 degrees wide, 20 degrees outwards (the same page).
None of them meets the floor."""
FEET = ("LFoot", "RFoot")
CELLS = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")
BUMPERS = tuple(f"{foot}/Bumper/{side}" for foot in FEET for side in ("Left", "Right"))


class Senses:
    """The sensors of the robot in a world."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._torso = simulation.body("torso")
        self._acceleration, self._turning = simulation.sensor("acceleration"), simulation.sensor("turning")
        self._cells = {foot: [simulation.sensor(f"{foot}/FSR/{cell}") for cell in CELLS] for foot in FEET}
        self._sonars = {simulation.site(name): side for name, side in SONARS.items()}
        self._bumpers = {simulation.geom(name): name for name in BUMPERS}

    def feel(self) -> Feeling:
        """What the inertial unit and the feet feel."""
        values = self._simulation.data.sensordata.tolist()
        ahead, left = self._simulation.lean(self._torso)
        ax, ay, az = values[self._acceleration]
        wx, wy, wz = values[self._turning]
        return Feeling((ax, ay, az), (wx, wy, wz), (-left, ahead), {foot: self._weights(foot, values) for foot in FEET})

    def _weights(self, foot: str, values: list[float]) -> tuple[float, float, float, float]:
        """The weights on the four cells of a foot, kg."""
        front_left, front_right, rear_left, rear_right = (values[cell.start] / GRAVITY for cell in self._cells[foot])
        return front_left, front_right, rear_left, rear_right

    def bumpers(self) -> dict[str, float]:
        """Which bumpers of the feet are pressed: 1, else 0."""
        touched = self._simulation.touched(frozenset(self._bumpers))
        return {name: float(geom in touched) for geom, name in self._bumpers.items()}

    def listen(self) -> list[float]:
        """What the left and the right sonar hear: m."""
        data = self._simulation.data
        ahead, left, up = (data.xmat[self._torso][axis::3] for axis in range(3))
        heard = []
        for site, side in self._sonars.items():
            ways = [
                (
                    math.cos(pitch) * (math.cos(yaw) * ahead + math.sin(side * yaw) * left) + math.sin(pitch) * up
                ).tolist()
                for yaw, pitch in _CONE
            ]  # fmt: skip
            heard.append(min(self._simulation.distances(data.site_xpos[site].tolist(), ways, SONAR_RANGE)))
        return heard
