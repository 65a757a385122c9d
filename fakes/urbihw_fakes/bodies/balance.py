"""A Segway RMP that balances in MuJoCo: it leans to accelerate, can be pushed over, and slips.

The controller of the real machine is not known.  This one is a state feedback for balance (speed, lean, rate of the
lean), with gains from the linear model of ``models/segway.xml`` (linear-quadratic, weights 200, 100, 5, and 0.002 for
the torque), and one of speed alone on the casters of the tractor mode.  Both follow a speed that is ramped as in the
plain machine; so a balancing base first rolls back a little when it is to go ahead.  Without motors it topples from its
balance, in a few seconds.
"""

from __future__ import annotations

from urbihw_fakes.bodies.simulation import Simulation
from urbihw_fakes.bodies.wheels import Wheels
from urbihw_fakes.segway.body import (
    FALLEN,
    MOST_ACCELERATION,
    MOST_TURN_ACCELERATION,
    STEP,
    WHEEL_DISTANCE,
    Body,
    towards,
)  # fmt: skip

WHEEL_RADIUS = 0.24
SUBSTEPS = 5
SPEED_GAIN, LEAN_GAIN, RATE_GAIN = 316.0, 722.0, 207.0
"""N m of both motors per m/s, rad and rad/s."""
TURN_GAIN, TURN_GAIN_OF_SUM = 25.0, 60.0
"""N m of each motor per rad/s, and per rad."""
MOST_TURN_TORQUE = 20.0
TRACTOR_GAIN = 150.0
"""N m of both motors per m/s."""


class BalancingBody(Body):
    """A base in a world, on two wheels or with ``tractor`` on casters; ``world`` as in ``simulation``.

    Raises:
        UnknownRequest: as in ``Simulation``.
    """

    def __init__(self, world: str, tractor: bool = False) -> None:
        super().__init__()
        self.simulation = Simulation("segway", world, STEP / SUBSTEPS)
        self.base = Wheels(self.simulation)
        self._number = self.simulation.body("base")
        if not tractor:
            for name in ("front_caster", "rear_caster"):
                self.simulation.model.geom_contype[self.simulation.geom(name)] = 0
        self._planned_speed = self._planned_turn = 0.0
        self._turn_sum = 0.0
        self._measure()

    def drive(self, speed: float, turn: float, acceleration: float, balancing: bool) -> None:
        self._planned_speed = towards(self._planned_speed, speed, MOST_ACCELERATION * acceleration * STEP)
        self._planned_turn = towards(self._planned_turn, turn, MOST_TURN_ACCELERATION * STEP)
        for _ in range(SUBSTEPS):
            ahead = self._balance() if balancing else TRACTOR_GAIN * (self._planned_speed - self.speed)
            aside = self._steer()
            self._step(ahead / 2 - aside, ahead / 2 + aside)
        self._fall()

    def coast(self, stands: bool) -> None:
        """As in ``Body``; the motors are free."""
        self._planned_speed, self._planned_turn, self._turn_sum = self.speed, self.turn, 0.0
        for _ in range(SUBSTEPS):
            self._step(0.0, 0.0)
        self._fall()

    def push(self, lean: float) -> None:
        """As in ``Body``: somebody tilts it at once."""
        self.base.tilt(lean)
        self._measure()

    def lift(self) -> None:
        """As in ``Body``; it stands where it lay."""
        self.put(*self.base.pose)

    def put(self, x: float, y: float, heading: float) -> None:
        """Put the base somewhere, upright: m, m, rad."""
        self.base.put(x, y, heading)
        self.fallen = False
        self._planned_speed = self._planned_turn = self._turn_sum = 0.0
        self._measure()

    def _balance(self) -> float:
        """N m of both motors that keep it up and bring it to the planned speed."""
        error = self.speed - self._planned_speed
        return SPEED_GAIN * error + LEAN_GAIN * self.pitch + RATE_GAIN * self.pitch_rate

    def _steer(self) -> float:
        """N m that the right motor has more than both on average, and the left one less."""
        error = self._planned_turn - self.turn
        total = self._turn_sum + TURN_GAIN_OF_SUM * error * STEP / SUBSTEPS
        self._turn_sum = max(-MOST_TURN_TORQUE, min(MOST_TURN_TORQUE, total))
        return TURN_GAIN * error + self._turn_sum

    def _step(self, left: float, right: float) -> None:
        most = self.base.most
        self.left_torque, self.right_torque = (max(-most, min(most, torque)) for torque in (left, right))
        self.base.drive(left, right)
        self.simulation.step()
        self._measure()
        dt = STEP / SUBSTEPS
        self.forward += self.speed * dt
        self.yaw += self.turn * dt
        self.left += self.left_speed * dt
        self.right += self.right_speed * dt

    def _measure(self) -> None:
        """What its sensors tell: gyros, and how fast the wheels turn, seen from the floor."""
        self.pitch, self.roll = self.simulation.lean(self._number)
        self.pitch_rate = self.base.pitch_rate
        left, right = ((speed + self.pitch_rate) * WHEEL_RADIUS for speed in self.base.speeds)
        self.speed, self.turn = (left + right) / 2, (right - left) / WHEEL_DISTANCE
        self.x, self.y, self.heading = self.base.pose

    def _fall(self) -> None:
        self.drain(STEP)
        self.fallen = self.fallen or abs(self.pitch) >= FALLEN
