"""A Bioloid humanoid in MuJoCo: eighteen AX-12 are its joints, and an AX-S1 is its head.

At the start it stands with its torque on, as its own controller would have left it.  Without torque it falls, and
somebody has to put it on its feet again (``stand``).

Choices: the curve of the infra-red sensors, of which the manual says only that a larger value is nearer, and that below
5 cm all is 255; their light is not modelled.
"""

from __future__ import annotations

import math

from urbihw_fakes.bioloid.kit import SENSORS, SERVOS, Bioloid
from urbihw_fakes.bodies.joint_servo import STEP, JointServo
from urbihw_fakes.bodies.simulation import Simulation
from urbihw_fakes.device import Answer
from urbihw_fakes.dynamixel.ax12 import DEGREES
from urbihw_fakes.dynamixel.axs1 import AxS1

PERIOD = 2 * STEP
"""s between two advances of the body without a request."""
LONGEST_GAP = 10.0
"""s; a longer pause of the caller is no time for the body."""
MIDDLE = 511.5
RADIANS = math.radians(DEGREES)
"""rad of one position step."""
MOUNTED = {7: -45.0, 8: 45.0}
"""Degrees of the servos that are not mounted straight."""
READY = (235, 788, 279, 744, 462, 561, 358, 666, 507, 516, 341, 682, 240, 783, 647, 376, 507, 516)
"""Positions of the servos 1 to 18 in which the kit's motions begin (RoboPlus, page "Init" of the humanoid's file;
as remembered: UNCONFIRMED)."""
SETTLING = 0.5
"""s until a robot that was put on its feet stands still, which it has done before anybody connects."""
PUSH_TIME = 0.1
"""s that a push lasts."""
IR_RANGE = 2.0
"""m; nothing is seen beyond."""
_IR_NEAR, _IR_HALF = 0.05, 0.15


class HeadSensor(AxS1):
    """An AX-S1 whose infra-red sensors look into a world."""

    def __init__(self, unit: int, simulation: Simulation) -> None:
        super().__init__(unit)
        self._simulation = simulation
        self._site = simulation.site("head")

    def sense(self, address: int = 0, count: int = 0xFFFF) -> None:
        """As in ``Unit``, with the distances of this moment."""
        data = self._simulation.data
        x, y = ([float(value) for value in data.site_xmat[self._site][column::3]] for column in (0, 1))
        ways = (y, x, [-value for value in y])
        self.ir(*map(reading, self._simulation.distances(data.site_xpos[self._site], ways, IR_RANGE)))
        super().sense(address, count)


class Humanoid(Bioloid):
    """The kit as a humanoid in a world; ``world`` as in ``simulation``.

    Attributes:
        simulation: its world. servos: by their numbers from 1 on.

    Raises:
        UnknownRequest: as in ``Simulation``.
    """

    def __init__(self, world: str, *, baud: int | None = None, cm5: bool = False) -> None:
        self.simulation = simulation = Simulation("bioloid", world, STEP)
        self._servos = [JointServo(number, READY[number - 1]) for number in SERVOS]
        joints = [simulation.joint(str(number)) for number in SERVOS]
        self._places, self._speeds = [place for place, _ in joints], [speed for _, speed in joints]
        self._motors = [simulation.actuator(str(number)) for number in SERVOS]
        self._torso = simulation.body("torso")
        self._start = simulation.pose(self._torso)
        self._braking = float(simulation.model.actuator_biasprm[self._motors[0]][2])
        self._body_now: float | None = None
        self._push_left = 0.0
        units = [*self._servos, *(HeadSensor(number, simulation) for number in SENSORS)]
        super().__init__(units=units, baud=baud, cm5=cm5)
        for servo in self._servos:
            servo.registers.put("torque_enable", 1)
        self.stand()
        self._run(round(SETTLING / STEP))
        simulation.data.time = 0.0

    # --- the wire -------------------------------------------------------------------------------------------------

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """As in ``ServoBus``, with the body as it is by then."""
        self.advance(now)
        return super().receive(data, now)

    def tick(self, now: float) -> list[Answer]:
        self.advance(now)
        return super().tick(now)

    def due(self) -> float | None:
        """When the body wants to move on: it falls also without a request, and a request finds it up to date."""
        return None if self._body_now is None else self._body_now + PERIOD

    # --- the body -------------------------------------------------------------------------------------------------

    def advance(self, now: float) -> None:
        """Let the body move on to ``now``."""
        if self._body_now is None or now - self._body_now > LONGEST_GAP:
            self._body_now = now
        steps = int((now - self._body_now) / STEP + 1e-6)
        if steps > 0:
            self._body_now += steps * STEP
            self._run(steps)

    def stand(self) -> None:
        """Put it on its feet where it started: joints with torque as they are, the others in the pose of the start."""
        self.simulation.reset()
        data = self.simulation.data
        for servo, place, zero, raw in zip(self._servos, self._places, _ZEROS, READY, strict=True):
            data.qpos[place] = ((servo.position if servo.driven else raw) - zero) * RADIANS
        self.simulation.put_on_feet("torso", ("right_sole", "left_sole"), self._start)
        self._push_left = 0.0
        self._read_joints()

    def push(self, forward: float, left: float) -> None:
        """Push its chest for ``PUSH_TIME``; N, ahead and to the left of it."""
        heading = self.simulation.pose(self._torso)[2]
        cos, sin = math.cos(heading), math.sin(heading)
        force = (forward * cos - left * sin, forward * sin + left * cos, 0.0)
        self.simulation.data.xfrc_applied[self._torso][:3] = force
        self._push_left = PUSH_TIME

    @property
    def height(self) -> float:
        """How high its hips are: m."""
        return float(self.simulation.data.xpos[self._torso][2])

    @property
    def tilt(self) -> float:
        """How far its trunk leans from upright: rad."""
        return self.simulation.tilt(self._torso)

    @property
    def place(self) -> tuple[float, float, float]:
        """Where it is, and where it faces: m, m, rad."""
        return self.simulation.pose(self._torso)

    def _run(self, steps: int) -> None:
        model, data = self.simulation.model, self.simulation.data
        for servo, motor in zip(self._servos, self._motors, strict=True):
            servo.prepare()
            # A motor that nothing drives is open: what its turning makes does not brake it.
            model.actuator_biasprm[motor][2] = self._braking if servo.driven else 0.0
        for _ in range(steps):
            data.ctrl[self._motors] = [servo.pull() for servo in self._servos]
            self.simulation.step()
            self._read_joints()
        for servo in self._servos:
            servo.finish(steps * STEP)
        if self._push_left > 0.0:
            self._push_left -= steps * STEP
            if self._push_left <= 0.0:
                data.xfrc_applied[self._torso][:] = 0.0

    def _read_joints(self) -> None:
        data = self.simulation.data
        angles, speeds = data.qpos[self._places].tolist(), data.qvel[self._speeds].tolist()
        for servo, angle, speed, zero in zip(self._servos, angles, speeds, _ZEROS, strict=True):
            servo.follow(zero + angle / RADIANS, speed / RADIANS)


_ZEROS = [MIDDLE + MOUNTED.get(number, 0.0) / DEGREES for number in SERVOS]
"""Positions of the servos in the pose of the model."""


def reading(metres: float) -> int:
    """What an infra-red sensor of an AX-S1 makes of a distance."""
    share = (1 + (_IR_NEAR / _IR_HALF) ** 2) / (1 + (metres / _IR_HALF) ** 2)
    return 0 if metres >= IR_RANGE else min(255, round(255 * share))


def describe(kit: Humanoid) -> str:
    """Where it is, in a line."""
    x, y, heading = kit.place
    fallen = " (fallen)" if kit.tilt > math.radians(60) else ""
    return (f"{x:.3f} {y:.3f} {math.degrees(heading):.1f}, hips {kit.height:.3f} m high, "
            f"leans {math.degrees(kit.tilt):.0f} degrees{fallen}")  # fmt: skip

