"""The motors of a MuJoCo model: actuators of joints, with the two modes of a motor of Webots.

With a finite target position a motor goes there, no faster than its maximum speed; with the position inf it turns at
its target speed.  A ``<velocity>`` actuator reaches a position by a proportional control of its speed, a ``<position>``
actuator turns at a speed by a target that moves on.  An actuator of another kind takes a torque only.
"""

from __future__ import annotations

import math
from typing import Any, Final

from urbihw.platforms.webots.simulator import MOTOR, SimDevice

DEFAULT_SPEED: Final = 10.0
"""Maximum speed in rad/s or m/s of a motor whose model names none, as of a motor of Webots (RotationalMotor node)."""
POSITION_GAIN: Final = 10.0
"""1/s: speed of a ``<velocity>`` actuator for the distance to its target position."""
LEAD_S: Final = 0.1
"""A ``<position>`` actuator that turns by speed has its target this much ahead, at most."""


class Motor:
    """One actuator of a joint."""

    def __init__(self, model: Any, data: Any, index: int, joint: int) -> None:
        actuator, hinge = model.actuator(index), model.joint(joint)
        self._data = data
        self._index = index
        self._qpos, self._qvel = int(hinge.qposadr[0]), int(hinge.dofadr[0])
        stiffness, damping = -float(actuator.biasprm[1]), -float(actuator.biasprm[2])
        self._by_position = stiffness > 0
        self._by_speed = not self._by_position and damping > 0
        limited = bool(hinge.limited[0])
        low, high = (float(each) for each in hinge.range) if limited else (-math.inf, math.inf)
        control = float(actuator.ctrlrange[1]) if bool(actuator.ctrllimited[0]) else math.inf
        force = float(actuator.forcerange[1]) if bool(actuator.forcelimited[0]) else math.inf
        self._fastest = control if self._by_speed and control < math.inf else DEFAULT_SPEED
        self._range = low, high
        named = f"{actuator.name} max velocity"
        numerics = {model.numeric(i).name: float(model.numeric(i).data[0]) for i in range(model.nnumeric)}
        self._fastest = numerics.get(named, self._fastest)
        self.device = SimDevice(str(actuator.name), MOTOR, {
            "min": low, "max": high, "max velocity": self._fastest, "max torque": force,
            "linear": float(int(hinge.type[0]) == 2),
        })  # fmt: skip
        self.hold()

    def hold(self) -> None:
        """Stand: the first state, and that after a stop."""
        self._target = math.inf if self._by_speed else self.position
        self._speed = 0.0 if self._by_speed else self._fastest
        self._place = self.position
        self._data.ctrl[self._index] = 0.0 if not self._by_position else self._place

    @property
    def position(self) -> float:
        """The angle of its joint in rad, or the way in m."""
        return float(self._data.qpos[self._qpos])

    def values(self) -> tuple[float, float, float]:
        """Return position, speed and torque."""
        return self.position, float(self._data.qvel[self._qvel]), float(self._data.actuator_force[self._index])

    def write(self, item: str, value: float) -> None:
        """See ``BackEnd.write``.  Raises ValueError."""
        if item == "torque":
            if self._by_position or self._by_speed:
                raise ValueError(f"motor {self.device.name!r} of this model takes no torque: it is no <motor>")
            self._data.ctrl[self._index] = value
            return
        if not (self._by_position or self._by_speed):
            raise ValueError(f"motor {self.device.name!r} of this model takes a torque only: it is a <motor>")
        if item == "position":
            if math.isinf(self._target) or math.isinf(value):
                self._place = self.position
            if math.isinf(value) and not math.isinf(self._target):
                self._speed = 0.0
            elif not math.isinf(value) and math.isinf(self._target):
                self._speed = self._fastest
            self._target = value if math.isinf(value) else min(max(value, self._range[0]), self._range[1])
        elif item == "velocity":
            self._speed = min(max(value, -self._fastest), self._fastest)
        elif item == "max velocity":
            self._speed = min(abs(value), self._fastest) if not math.isinf(self._target) else self._speed
        else:
            raise ValueError(f"a motor has no {item}")

    def is_on_its_way(self) -> bool:
        """Whether its control changes in the next time step of the physics."""
        if self._by_position:
            return self._speed != 0.0 if math.isinf(self._target) else self._place != self._target
        return self._by_speed and not math.isinf(self._target)

    def control(self, seconds: float) -> None:
        """Set its control for a time step of the physics."""
        by_target = not math.isinf(self._target)
        if self._by_speed:
            away = (self._target - self.position) * POSITION_GAIN if by_target else self._speed
            fastest = abs(self._speed)
            self._data.ctrl[self._index] = min(max(away, -fastest), fastest)
        elif self._by_position:
            reach = abs(self._speed) * seconds
            if by_target:
                way = self._target - self._place
                self._place += min(max(way, -reach), reach)
            else:
                moved = min(max(self._place + self._speed * seconds, self._range[0]), self._range[1])
                lead = abs(self._speed) * LEAD_S
                self._place = min(max(moved, self.position - lead), self.position + lead)
            self._data.ctrl[self._index] = self._place
