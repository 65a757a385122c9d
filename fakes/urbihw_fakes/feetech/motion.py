"""The motor of a Feetech servo: one degree of freedom with a speed profile, a load, end stops, heat and current.

The horn is at `angle`, in steps of the sensor, counted without a jump over any number of turns. A `drive` of -1..1 and
an external torque `load` (fraction of the stall torque, positive towards larger positions) give the speed; friction
holds the horn still when both nearly cancel. Model choices: friction, stiffness, heating, a current in proportion to
the drive. Not covered: phase bits 0, 1 and 5 to 7, the gains of the speed loop, sag of the voltage.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, inf, sqrt

STEP = 0.002  # s of one step of the physics
FRICTION = 0.02  # of stall torque
AMBIENT = 30.0  # degC
HEATING = 60.0  # degC above ambient after a long full drive
HEAT_TIME = 300.0  # s
ACCELERATION_UNIT = 100.0  # step/s2
APPROACH = 40.0  # 1/s: speed of a joint for one step of distance
CREEP = 20.0  # steps/s: the slowest approach


@dataclass(frozen=True, slots=True)
class Order:
    """What the registers ask of the motor.

    Attributes:
        kind: "off", "position", "speed" or "pwm".
        goal: present position wanted minus present position (kind position): distance still to go, in steps.
        rate: for position the largest speed, for speed the wanted one (steps/s), for pwm the drive.
        acceleration: steps/s2; inf for none.
        limit: largest drive, 0..1.
        stiffness: drive for one step of error of a horn that is held back.
        dead: distance that is not corrected, in steps.
    """

    kind: str
    goal: float = 0.0
    rate: float = 0.0
    acceleration: float = inf
    limit: float = 1.0
    stiffness: float = 0.032
    dead: float = 1.0


class Motor:
    """The body of one servo.

    Attributes:
        angle: of the horn, steps.
        speed: steps/s.
        drive: -1..1.
        load: external torque, fraction of stall torque.
        held: the horn is held by hand: it does not turn.
        stops: lowest and highest angle that the mechanics allow.
        celsius, held_celsius: temperature, and the value it is fixed at.
    """

    def __init__(self, angle: float, full_speed: float, stops: tuple[float, float] = (-inf, inf)) -> None:
        self.angle = angle
        self.full_speed = full_speed
        self.speed = 0.0
        self.drive = 0.0
        self.load = 0.0
        self.held = False
        self.stops = stops
        self.celsius = AMBIENT
        self.held_celsius: float | None = None

    def run(self, order: Order, span: float = STEP) -> None:
        """Advance by one step of `span` seconds."""
        self.drive = self._drive(order, span)
        push = self.drive + self.load
        push = 0.0 if abs(push) <= FRICTION else push - (FRICTION if push > 0 else -FRICTION)
        self.speed = 0.0 if self.held else push * self.full_speed
        moved = self.speed * span
        if order.kind == "position" and abs(order.goal) <= abs(moved) and moved * order.goal > 0:
            moved = order.goal
        self.angle += moved
        low, high = self.stops
        if not low <= self.angle <= high:
            self.angle = min(max(self.angle, low), high)
            self.speed = 0.0
        self._warm(span)

    def turn(self, steps: float) -> None:
        """Turn the horn by hand, as far as the end stops let it."""
        low, high = self.stops
        self.angle = min(max(self.angle + steps, low), high)

    def _drive(self, order: Order, span: float) -> float:
        if order.kind == "off":
            return 0.0
        if order.kind == "pwm":
            return max(-order.limit, min(order.limit, order.rate))
        if order.kind == "speed":
            wanted = order.rate
        else:
            if abs(order.goal) <= order.dead:
                return max(-order.limit, min(order.limit, -self.load))
            # Slower and slower towards the goal, and never faster than the motor can still come to a stand at it.
            far = abs(order.goal)
            wanted = min(order.rate, max(far * APPROACH, CREEP), sqrt(2 * order.acceleration * far), self.full_speed)
            wanted = wanted if order.goal > 0 else -wanted
        change = order.acceleration * span
        wanted = min(max(wanted, self.speed - change), self.speed + change)
        drive = wanted / self.full_speed - self.load + (FRICTION if wanted > 0 else -FRICTION if wanted < 0 else 0.0)
        if order.kind == "position" and order.rate > 0 and self._is_blocked(order.goal):
            drive = order.goal * order.stiffness
        return max(-order.limit, min(order.limit, drive))

    def _is_blocked(self, goal: float) -> bool:
        """Return whether the horn is held, or at an end stop that is between it and the goal."""
        low, high = self.stops
        return self.held or (goal > 0 and self.angle >= high) or (goal < 0 and self.angle <= low)

    def _warm(self, span: float) -> None:
        if self.held_celsius is not None:
            self.celsius = self.held_celsius
        else:
            goal = AMBIENT + HEATING * self.drive * self.drive
            self.celsius = goal + (self.celsius - goal) * exp(-span / HEAT_TIME)
