"""A TriBot whose motors on A and C turn wheels in MuJoCo: they slip, stall and push; the ultrasonic sensor hears.

The brick's part stays: powers, ramps, limits, counters.  The motor on B, the claw, moves nothing, as without a world;
light and sound are set by hand.

Choices: a regulated or braked motor answers to a wrong speed with ``REGULATED_GAIN``, another one as a motor of direct
current does; the ultrasonic sensor hears the nearest thing in a cone of 2 times ``CONE``.
"""

from __future__ import annotations

import math

from urbihw_fakes.bodies.simulation import Simulation
from urbihw_fakes.bodies.wheels import Wheels
from urbihw_fakes.nxt import codes
from urbihw_fakes.nxt.motor import COASTING, FULL_SPEED, NOMINAL, Motor
from urbihw_fakes.nxt.tribot import TriBot

STEP = 0.002
FULL_TORQUE = 0.5
"""N m of a motor that stands, at 9 V."""
PLAIN_GAIN = FULL_TORQUE / math.radians(FULL_SPEED)
REGULATED_GAIN = 0.08
"""N m per rad/s."""
CONE = math.radians(15)
FARTHEST = 2.5
"""m that the ultrasonic sensor measures."""


class WheelMotor(Motor):
    """A motor whose axle is a wheel of a body."""

    def __init__(self) -> None:
        super().__init__()
        self._wanted = 0.0
        self._gain = 0.0
        self._most = 0.0

    def advance(self, seconds: float, volts: float) -> None:
        """As in ``Motor``, but what it wants is left to the body."""
        wanted, settling = self._drive(seconds, volts)
        self._most = FULL_TORQUE * volts / NOMINAL
        firm = self.mode & codes.BRAKE or (self.mode & codes.REGULATED and self.regulation)
        self._gain = 0.0 if settling == COASTING else REGULATED_GAIN if firm else PLAIN_GAIN
        self._wanted = math.radians(wanted)
        if self.jammed:
            # Somebody holds it, as firmly as it can pull.
            self._wanted, self._gain, self._most = 0.0, REGULATED_GAIN, FULL_TORQUE

    def torque(self) -> float:
        """N m of the coming step."""
        torque = self._gain * (self._wanted - math.radians(self.speed))
        return max(-self._most, min(self._most, torque))

    def follow(self, angle: float, speed: float) -> None:
        """What the body has turned it to: rad and rad/s.  A limit of degrees may be reached."""
        self.position, self.speed = math.degrees(angle), math.degrees(speed)
        if self.limit and abs(self.position - self._began_at) >= self.limit:
            self.power, self.limit, self.run_state = 0, 0, codes.IDLE


class SimulatedTriBot(TriBot):
    """A TriBot in a world; ``world`` as in ``simulation``.  Raises UnknownRequest."""

    pace = 0.02

    def __init__(self, world: str) -> None:
        self.simulation = Simulation("nxt", world, STEP)
        self.base = Wheels(self.simulation)
        self._eyes = self.simulation.site("eyes")
        self._bumper = frozenset({self.simulation.geom("bumper")})
        self._owed = 0.0
        super().__init__()
        self._wheels = (WheelMotor(), WheelMotor())
        self.brick.motors[2], self.brick.motors[0] = self._wheels
        self._look_around()

    def distance(self) -> float:
        """As in ``TriBot``: to the nearest thing in its cone."""
        data = self.simulation.data
        heading = self.base.pose[2]
        angles = (heading + share * CONE for share in (-1.0, -0.5, 0.0, 0.5, 1.0))
        ways = [(math.cos(angle), math.sin(angle), 0.0) for angle in angles]
        nearest = min(self.simulation.distances(data.site_xpos[self._eyes], ways, FARTHEST + 1.0))
        return nearest if nearest < FARTHEST + 1.0 else math.inf

    def put(self, x: float, y: float, heading: float) -> None:
        """Put the robot somewhere: m, m, rad, of the middle of its axle."""
        self.base.put(x, y, heading)
        self._look_around()

    def describe_place(self) -> str:
        x, y, heading = self.base.pose
        return f"at {x:.3f} {y:.3f}, heading {math.degrees(heading):.0f}"

    def _move(self, seconds: float) -> None:
        self._owed += seconds
        steps = int(self._owed / STEP + 1e-6)
        self._owed -= steps * STEP
        for _ in range(steps):
            self.base.drive(*(motor.torque() for motor in self._wheels))
            self.simulation.step()
            for motor, angle, speed in zip(self._wheels, self.base.angles, self.base.speeds, strict=True):
                motor.follow(angle, speed)
        self._look_around()

    def _look_around(self) -> None:
        self.x, self.y, _ = self.simulation.data.site_xpos[self._eyes].tolist()
        self.heading = self.base.pose[2]
        self.touch.pressed = self.pushed or bool(self.simulation.touched(self._bumper))
