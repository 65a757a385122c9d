"""A Pioneer whose wheels roll in MuJoCo: they slip and stall, its bumpers touch, and it pushes what is light enough.

The controller's part stays: it plans the speeds (``Axis``) and believes its encoders.  What the body does with them is
physics: the wheels' motors have a limited torque, the floor a friction.

Choices: the gains of the wheels' speed controllers, of two terms as the firmware's; a wheel has stalled when it turns
at less than ``STALL_SHARE`` of what is wanted for ``STALL_TIME``; the sensors stay level when the robot tilts.
"""

from __future__ import annotations

import math

from urbihw_fakes.bodies.simulation import Simulation
from urbihw_fakes.bodies.walls import SimulatedWorld
from urbihw_fakes.bodies.wheels import Wheels
from urbihw_fakes.p3dx.body import BUMPERS, HALF_TRACK, STEP, Body

WHEEL_RADIUS = 0.19530 / 2
SUBSTEPS = 2
GAIN, GAIN_OF_SUM = 1.0, 5.0
"""N m per rad/s, and N m per rad."""
AT_REST = 0.02
"""rad/s: slower than this, friction alone holds a wheel that is to stand."""
STALL_TIME = 0.2
STALL_SHARE = 0.3
STALLED_SPEED = 0.1
"""m/s at which it goes on pushing."""


class SimulatedBody(Body):
    """A Pioneer in a world of MuJoCo; ``world`` as in ``simulation``.  Raises UnknownRequest."""

    def __init__(self, world: str) -> None:
        self.simulation = simulation = Simulation("p3dx", world, STEP / SUBSTEPS)
        self.base = Wheels(simulation)
        self._bumpers = {
            simulation.geom(f"{end}{number}"): (end, number) for end in ("front", "rear") for number in range(BUMPERS)
        }
        self._sums = [0.0, 0.0]
        self._slow_for = [0.0, 0.0]
        super().__init__(SimulatedWorld(simulation, self.base.pose), slip=0.0)

    @property
    def wheels(self) -> tuple[float, float]:
        """As in ``Body``: as the wheels turn."""
        left, right = self.base.speeds
        return left * WHEEL_RADIUS, right * WHEEL_RADIUS

    @property
    def moving(self) -> bool:
        """Whether a wheel turns or the robot is moved."""
        return self.base.moving or max(map(abs, self.wheels)) > 5e-3

    @property
    def turn_rate(self) -> float:
        """As in ``Body``: what a gyro on it feels."""
        return self.base.turn_rate

    def set_pose(self, x: float, y: float, heading: float) -> None:
        """As in ``Body``; it stands still there."""
        self.base.put(x, y, heading)
        self.pose = self.base.pose

    def _step(self, dt: float) -> None:
        allowed = self.motors and not self.halted
        way = self.forward.step(dt, allowed=allowed)
        angle = self.turning.step(dt, allowed=allowed)
        before = self.base.angles
        for _ in range(SUBSTEPS):
            self._drive_wheels(dt / SUBSTEPS)
            self.simulation.step()
        left, right = ((after - was) * WHEEL_RADIUS for after, was in zip(self.base.angles, before, strict=True))
        self._correct_goals(way - (left + right) / 2, angle - (right - left) / 2 / HALF_TRACK)
        self._update_odometry((left + right) / 2, (right - left) / 2 / HALF_TRACK)
        self._drain(dt)
        self.pose = self.base.pose
        self._feel_bumpers()
        self._watch_stall(dt)

    def _wanted_wheels(self) -> tuple[float, float]:
        spread = self.turning.speed * HALF_TRACK
        return self.forward.speed - spread, self.forward.speed + spread

    def _drive_wheels(self, dt: float) -> None:
        """The torque of each motor for one step of ``dt`` seconds; switched off, they are free."""
        torques = []
        for side, (wanted, speed) in enumerate(zip(self._wanted_wheels(), self.base.speeds, strict=True)):
            error, torque = wanted / WHEEL_RADIUS - speed, 0.0
            at_rest = wanted == 0.0 and abs(error) < AT_REST
            if self.motors and not at_rest:
                # The sum is bounded with the torque, so that a stalled wheel remembers nothing of its stall.
                total = self._sums[side] + GAIN_OF_SUM * error * dt
                self._sums[side] = max(-self.base.most, min(self.base.most, total))
                torque = GAIN * error + self._sums[side]
            else:
                self._sums[side] = 0.0
            torques.append(torque)
        self.base.drive(*torques)

    def _correct_goals(self, way: float, angle: float) -> None:
        """A distance counts as the encoders say, not as it was planned; ``way`` and ``angle`` are what lacks."""
        for axis, lacking in ((self.forward, way), (self.turning, angle)):
            if axis.goal is not None:
                axis.goal += lacking

    def _feel_bumpers(self) -> None:
        pressed = [self._bumpers[geom] for geom in self.simulation.touched(frozenset(self._bumpers))]
        self.front = {number for end, number in pressed if end == "front"}
        self.rear = {number for end, number in pressed if end == "rear"}

    def _watch_stall(self, dt: float) -> None:
        """A stalled wheel is flagged until it turns again or is not wanted to; a distance ends at a bumper."""
        for side, (wanted, real) in enumerate(zip(self._wanted_wheels(), self.wheels, strict=True)):
            slow = abs(wanted) > 0.01 and real * math.copysign(1.0, wanted) < STALL_SHARE * abs(wanted)
            self._slow_for[side] = self._slow_for[side] + dt if slow and self.motors else 0.0
        self.stalled = (self._slow_for[0] >= STALL_TIME, self._slow_for[1] >= STALL_TIME)
        if any(self.stalled):
            # The controller does not plan on while nothing moves, or it would have to brake from there.
            self.forward.speed = max(-STALLED_SPEED, min(STALLED_SPEED, self.forward.speed))
        way = self.forward.speed
        if (self.bump_stall & 1 and self.front and way > 0) or (self.bump_stall & 2 and self.rear and way < 0):
            self.forward.goal = None
