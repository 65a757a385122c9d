"""A base on two wheels in a world: what turns them, how far they have turned, and where they carried it.

The model has a body and a joint ``base``, and wheels ``left`` and ``right``, each a joint, a geom and a motor.
"""

from __future__ import annotations

import math

from urbihw_fakes.bodies.simulation import Simulation

_SIDES = ("left", "right")


class Wheels:
    """The base of ``simulation``; angles in rad, left wheel first.

    Attributes:
        most: N m, the torque that a motor has at most.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self._base = simulation.body("base")
        self._place, self._velocity = simulation.joint("base")
        self._height = float(simulation.data.xpos[self._base][2])
        self._joints = [simulation.joint(side) for side in _SIDES]
        self._motors = [simulation.actuator(side) for side in _SIDES]
        self.most = float(simulation.model.actuator_ctrlrange[self._motors[0]][1])

    @property
    def angles(self) -> tuple[float, float]:
        """How far the wheels have turned."""
        left, right = (float(self.simulation.data.qpos[place]) for place, _ in self._joints)
        return left, right

    @property
    def speeds(self) -> tuple[float, float]:
        """How fast they turn: rad/s."""
        left, right = (float(self.simulation.data.qvel[speed]) for _, speed in self._joints)
        return left, right

    @property
    def pose(self) -> tuple[float, float, float]:
        """Where the base is: x, y, heading (m, m, rad)."""
        return self.simulation.pose(self._base)

    @property
    def turn_rate(self) -> float:
        """How fast the base turns to the left: rad/s."""
        return float(self.simulation.data.qvel[self._velocity + 5])

    @property
    def pitch_rate(self) -> float:
        """How fast the base leans forward: rad/s."""
        return float(self.simulation.data.qvel[self._velocity + 4])

    @property
    def moving(self) -> bool:
        """Whether the base moves, by its wheels or otherwise."""
        velocity = self.simulation.data.qvel[self._velocity : self._velocity + 6]
        return float(abs(velocity).max()) > 5e-3

    def drive(self, left: float, right: float) -> None:
        """The torques of the motors from now on: N m, bounded by ``most``; 0 leaves a wheel free."""
        for motor, torque in zip(self._motors, (left, right), strict=True):
            self.simulation.data.ctrl[motor] = torque

    def set_friction(self, friction: float) -> None:
        """The friction of the wheels on the floor, 0..: 0.7 is a hard floor, 0.05 ice."""
        for side in _SIDES:
            self.simulation.model.geom_friction[self.simulation.geom(side)][0] = friction

    def tilt(self, angle: float) -> None:
        """Lean the base forward at once, on its wheels: rad."""
        quaternion = self.simulation.data.qpos[self._place + 3 : self._place + 7]
        w, x, y, z = quaternion.tolist()
        cos, sin = math.cos(angle / 2), math.sin(angle / 2)
        quaternion[:] = (w * cos - y * sin, x * cos - z * sin, w * sin + y * cos, x * sin + z * cos)
        self.simulation.forward()

    def put(self, x: float, y: float, heading: float) -> None:
        """Put the base somewhere, upright; it stands still there."""
        data, place, velocity = self.simulation.data, self._place, self._velocity
        data.qpos[place : place + 7] = (x, y, self._height, math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2))
        data.qvel[velocity : velocity + 6] = 0.0
        self.simulation.forward()
