"""The motion of an X-series servo: a trajectory planned by the firmware, and a motor that follows it.

Units here: position steps (4096 a turn), seconds, drive as a fraction -1..1 of full voltage, torque as a fraction of
stall torque. Positive is counter-clockwise. All numbers that are not in the sheet are model choices.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from urbihw_fakes.dynamixel.unit import STEP

TIME_CONSTANT = 0.008  # s until the speed is within 1/e of its final value
FRICTION = 0.01  # of stall torque


@dataclass(slots=True)
class Profile:
    """Planned motion: position and velocity of the trajectory, and their bounds (0: no bound)."""

    position: float = 0.0
    velocity: float = 0.0
    max_velocity: float = 0.0
    acceleration: float = 0.0

    def toward(self, goal: float) -> None:
        """Advance one step toward a position, braking in time to stop there."""
        gap = goal - self.position
        if gap == 0.0 and self.velocity == 0.0:
            return
        wanted = abs(gap) / STEP
        if self.max_velocity:
            wanted = min(wanted, self.max_velocity)
        if self.acceleration:
            # Whole steps lag half a step behind the ideal braking curve; this leaves room for it.
            lag = self.acceleration * STEP / 2
            wanted = min(wanted, sqrt(2 * self.acceleration * abs(gap) + lag * lag) - lag)
        self.change(wanted if gap > 0 else -wanted)
        travel = self.velocity * STEP
        if abs(gap) <= abs(travel) + 1e-3 and abs(self.velocity) <= (self.acceleration or 1e12) * STEP * 2:
            self.position, self.velocity = goal, 0.0
        else:
            self.position += travel

    def change(self, wanted: float) -> None:
        """Advance one step toward a velocity, within the acceleration."""
        if self.acceleration:
            most = self.acceleration * STEP
            self.velocity += max(-most, min(most, wanted - self.velocity))
        else:
            self.velocity = wanted


@dataclass(slots=True)
class Motor:
    """The geared motor: drive and external torque change speed and position, unless the horn is held by hand."""

    full_speed: float
    position: float = 0.0
    speed: float = 0.0
    drive: float = 0.0
    load: float = 0.0
    held: bool = False

    def turn(self, drive: float, full_speed: float) -> None:
        """Advance one step with `drive`; `full_speed` is the no-load speed at the present voltage."""
        self.drive = drive
        push = drive + self.load
        if abs(push) <= FRICTION:
            push = 0.0
        else:
            push -= FRICTION if push > 0 else -FRICTION
        self.speed += (push * full_speed - self.speed) * (STEP / TIME_CONSTANT)
        if abs(self.speed) < 1e-3 or self.held:
            self.speed = 0.0
        self.position += self.speed * STEP

    def hold_velocity(self, velocity: float, limit: float) -> float:
        """Return the drive that keeps `velocity` against load and friction, within `limit`."""
        sign = (velocity > 0) - (velocity < 0)
        needed = velocity / self.full_speed - self.load + sign * FRICTION
        return max(-limit, min(limit, needed))
