"""The physics of the machine: speed ramps, the lean of the body, counters, a battery.

    v = forward speed, w = yaw speed (counter-clockwise positive); left = v - w d / 2, right = v + w d / 2
    lean:  p'' = f^2 (atan(a / g) - p) - 2 z f p'      a balancing body leans in the direction of its
acceleration.  Without balance, the body falls onto its stand and stays there until it is lifted.

d is the 0.54 m of Player and Orca. All other numbers here (accelerations, mass, stiffness, battery) are guesses of
plausible size, not from a data sheet.
"""

from __future__ import annotations

import math

STEP = 0.01
"""Seconds of one servo frame."""
WHEEL_DISTANCE = 0.54
MOST_ACCELERATION = 2.0
MOST_TURN_ACCELERATION = 6.0
FALLEN = math.radians(38)
"""Lean at which the body lies on its stand."""

_GRAVITY = 9.81
_FREQUENCY = 9.0  # of the balance, 1/s
_DAMPING = 0.7
_TIP_RATE = 3.0  # of a falling body, 1/s
_COASTING = 1.5  # deceleration without motors, m/s^2 and rad/s^2
_MASS, _WHEEL_RADIUS = 70.0, 0.24
_FULL_VOLTS, _SAG = 77.5, 0.02  # V; V per N m
_IDLE_DRAIN, _WORK_DRAIN = 1e-4, 2e-6  # V/s; V per N m and s


class Body:
    """The machine, in SI units; `drive` or `coast` advances it by one servo frame.

    Attributes:
        speed, turn: forward in m/s, yaw in rad/s.
        forward, yaw, left, right: total travel, m and rad.
        pitch, pitch_rate, roll: rad, rad/s, rad; forward and left are positive.
        left_torque, right_torque: N m.
        x, y, heading: true pose on the floor, m and rad, relative to power-on.
        slip: share of the wheels' rotation that is lost; the counters do not show it.
        volts: of the battery, at rest.
        fallen: it lies on its stand.
    """

    def __init__(self) -> None:
        self.speed = self.turn = 0.0
        self.forward = self.yaw = self.left = self.right = 0.0
        self.pitch = self.pitch_rate = self.roll = 0.0
        self.left_torque = self.right_torque = 0.0
        self.x = self.y = self.heading = 0.0
        self.slip = 0.0
        self.volts = _FULL_VOLTS
        self.fallen = False

    @property
    def left_speed(self) -> float:
        """Speed of the left wheel on the ground, m/s."""
        return self.speed - self.turn * WHEEL_DISTANCE / 2

    @property
    def right_speed(self) -> float:
        """Speed of the right wheel on the ground, m/s."""
        return self.speed + self.turn * WHEEL_DISTANCE / 2

    @property
    def loaded_volts(self) -> float:
        """Voltage of the battery, while the motors pull."""
        return self.volts - _SAG * (abs(self.left_torque) + abs(self.right_torque))

    def drive(self, speed: float, turn: float, acceleration: float, balancing: bool) -> None:
        """Advance one servo frame with motors, towards `speed` and `turn`; `acceleration` is a share of the maximum."""
        before, turned = self.speed, self.turn
        self.speed = towards(before, speed, MOST_ACCELERATION * acceleration * STEP)
        self.turn = towards(turned, turn, MOST_TURN_ACCELERATION * STEP)
        gained = (self.speed - before) / STEP
        thrust = _MASS * gained * _WHEEL_RADIUS / 2
        spin = (self.turn - turned) / STEP * 2.0
        self.left_torque, self.right_torque = thrust - spin, thrust + spin
        if balancing:
            self._lean(math.atan2(gained, _GRAVITY))
        else:
            self.pitch = self.pitch_rate = 0.0
        self._travel()

    def coast(self, stands: bool) -> None:
        """Advance one servo frame without motors; the body falls unless it `stands` on casters."""
        self.speed = towards(self.speed, 0.0, _COASTING * STEP)
        self.turn = towards(self.turn, 0.0, _COASTING * STEP)
        self.left_torque = self.right_torque = 0.0
        if not stands and not self.fallen:
            # A controller that has settled leaves a lean too small to fall from.
            tip = math.copysign(max(abs(self.pitch), 1e-3), self.pitch)
            self.pitch_rate = _TIP_RATE * tip
            self.pitch = math.copysign(min(abs(tip + self.pitch_rate * STEP), FALLEN), tip)
            self.fallen = abs(self.pitch) >= FALLEN
            if self.fallen:
                self.pitch_rate = 0.0
        self._travel()

    def push(self, lean: float) -> None:
        """Tilt the body at once by `lean` rad."""
        self.pitch += lean

    def lift(self) -> None:
        """Put the body upright."""
        self.fallen = False
        self.pitch = self.pitch_rate = 0.0

    def drain(self, seconds: float) -> None:
        """What some time of the present torques takes from the battery."""
        work = abs(self.left_torque) + abs(self.right_torque)
        self.volts = max(0.0, self.volts - (_IDLE_DRAIN + _WORK_DRAIN * work) * seconds)

    def _lean(self, wanted: float) -> None:
        force = _FREQUENCY**2 * (wanted - self.pitch) - 2 * _DAMPING * _FREQUENCY * self.pitch_rate
        self.pitch_rate += force * STEP
        self.pitch += self.pitch_rate * STEP

    def _travel(self) -> None:
        self.forward += self.speed * STEP
        self.yaw += self.turn * STEP
        grip = 1 - self.slip
        middle = self.heading + self.turn * STEP * grip / 2
        self.x += self.speed * STEP * grip * math.cos(middle)
        self.y += self.speed * STEP * grip * math.sin(middle)
        self.heading += self.turn * STEP * grip
        self.left += self.left_speed * STEP
        self.right += self.right_speed * STEP
        self.drain(STEP)


def towards(value: float, goal: float, most: float) -> float:
    """The value after a change of at most ``most`` towards the goal."""
    return min(goal, value + most) if goal > value else max(goal, value - most)
