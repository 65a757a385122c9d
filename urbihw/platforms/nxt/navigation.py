"""The planner of an NXT with two driven wheels: odometry by the encoders of two motors, and speeds for them.

A layout names the driving motors (``nxt.steer(wheelL, wheelR)``), and may name a forward sensor
(``nxt.lookAhead(sonar, 0.05)``).  The geometry is ``nxt.wheelRadius``, ``nxt.track`` (m) and ``nxt.fullSpeed``
(rad/s of a motor at speed 100); their initial values are the options.  ``urbihw.navigation`` describes the rest.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Any, Final, Protocol

from urbihw.kernel.uobject import Origin, UVar
from urbihw.navigation.drive import DriveLimits
from urbihw.navigation.frames import Point
from urbihw.navigation.navigator import Navigator
from urbihw.navigation.odometry import Odometry
from urbihw.navigation.pilot import Pilot
from urbihw.platforms.arrival import Arrival
from urbihw.platforms.limits import DeviceLimits
from urbihw.platforms.nxt.motors import FULL, NxtServo
from urbihw.platforms.nxt.options import NxtOptions
from urbihw.platforms.nxt.sensors import UltraSonicSensor

CREEPING: Final = 5
"""Lowest speed of a motor, of 100, that the brick's regulation can keep."""
BRAKING: Final = 0.5
"""Deceleration of a wheel's rim assumed by the planner, m/s2; braked motors stop within some 0.1 s."""
FASTEST_COUNT: Final = 1100.0
"""Maximum speed of a motor in degrees per second: 170 rpm without load at 9 V, plus a margin (philohome.com)."""
LEAP: Final = 60.0
"""Degrees beyond that between two readings mean that the count was reset."""


class NxtOdometry(Odometry):
    """``nxt.odometry``"""


class NxtPlanner(Navigator):
    """``nxt.planner``"""

    slot_name = "nxt.planner"


class Geometry(Protocol):
    """What the planner needs of the brick."""

    wheelRadius: UVar
    track: UVar
    fullSpeed: UVar
    arrival: Arrival

    @property
    def options(self) -> NxtOptions:
        """The options of the settings."""
        ...

    def motor_limits(self, place: str) -> DeviceLimits:
        """The limits of the settings for the motor on a port."""
        ...


class NxtWheel:
    """A driving motor and the last reading of its encoder.

    Attributes:
        count: the last reading, in degrees.
        read_at: its kernel time, s.
        is_fresh: it was read since the last call of ``turned``.
    """

    def __init__(self, servo: NxtServo) -> None:
        self.servo = servo
        self.is_fresh = False
        self.count = 0.0
        self.read_at = -math.inf
        self._last: tuple[Any, float] | None = None
        self._last_at = -math.inf

    def add_count(self, count: float, stamp: float) -> None:
        """Add a reading of the encoder, in degrees; one older than the last is ignored: it comes from a worker that
        has ended."""
        if stamp > self.read_at:
            self.count, self.read_at, self.is_fresh = count, stamp, True

    def turned(self) -> float:
        """Return the degrees since the last call; 0 if the count was reset meanwhile."""
        last, now = self._last, (self.servo.place, self.count)
        seconds, self._last_at = self.read_at - self._last_at, self.read_at
        self.is_fresh = False
        self._last = now if self.servo.is_counting else None
        if last is None or self._last is None or last[0] != now[0]:
            return 0.0
        turned = now[1] - last[1]
        return turned if abs(turned) <= FASTEST_COUNT * seconds + LEAP else 0.0

    def has_turned_far(self) -> bool:
        """Return whether the last count that was used is more than a leap from 0."""
        return self._last is not None and abs(self._last[1]) > LEAP

    def forget_count(self) -> None:
        """Forget the last count: the next reading is a new origin."""
        self._last = None


class NxtWheels:
    """The two driving motors, as ``navigation.pilot.Wheels``."""

    pilot: Pilot

    def __init__(self, robot: Geometry, left: NxtServo, right: NxtServo) -> None:
        self._robot = robot
        self._wheels = NxtWheel(left), NxtWheel(right)
        self._matched_at = -math.inf
        self._ahead: tuple[UltraSonicSensor, float] | None = None

    def uses_motor(self, servo: NxtServo) -> bool:
        """Return whether a motor is one of the two."""
        return any(wheel.servo is servo for wheel in self._wheels)

    def look_ahead(self, sensor: UltraSonicSensor, place: float) -> None:
        """Use this sensor, ``place`` m in front of the axle, as the forward sensor."""
        self._ahead = sensor, place

    # ---------------------------------------------------------------- the way

    def add_reading(self, place: Any, rotation: float, stamp: float) -> None:
        """Add a reading, at a kernel time in s; with a reading of both wheels, report the distance to the pilot."""
        for wheel in self._wheels:
            if wheel.servo.place == place:
                wheel.add_count(rotation, stamp)
        if all(each.is_fresh for each in self._wheels) and self._match():
            self._show_way()

    def _match(self) -> bool:
        """Return whether the two readings are of the same moment; else the older one is discarded.

        After a pause one of them may be old: the robot would seem to turn by what this wheel moved meanwhile.
        """
        older, newer = sorted(self._wheels, key=lambda wheel: wheel.read_at)
        older.is_fresh = newer.read_at - older.read_at <= (newer.read_at - self._matched_at) / 2
        return older.is_fresh

    def _show_way(self) -> None:
        self._matched_at = stamp = max(wheel.read_at for wheel in self._wheels)
        # The counts of a brick that was just switched on.
        if not any(wheel.count for wheel in self._wheels) and any(wheel.has_turned_far() for wheel in self._wheels):
            for wheel in self._wheels:
                wheel.forget_count()
        radius, track = float(self._robot.wheelRadius.value), float(self._robot.track.value)
        left, right = (math.radians(wheel.turned()) * radius for wheel in self._wheels)
        self.pilot.show_way((left + right) / 2, (right - left) / track, stamp)

    # ---------------------------------------------------------------- what the pilot asks

    @property
    def devices(self) -> tuple[Hashable, ...]:
        """The ports of the two motors, without a motor that was freed."""
        return tuple(wheel.servo.place for wheel in self._wheels if wheel.servo.place is not None)

    @property
    def navigation(self) -> NxtOptions:
        """The settings of the robot for navigation."""
        return self._robot.options

    def order_speeds(self, v: float, w: float, origin: Origin) -> None:
        """Drive at these speeds, m/s and rad/s; if one wheel cannot, both are slowed down and keep the arc."""
        half = float(self._robot.track.value) / 2
        share = FULL / self._rim_speed()
        wanted = (v - w * half) * share, (v + w * half) * share
        scale = FULL / max(FULL, *map(abs, wanted))
        turns = math.copysign(scale, float(self._robot.wheelRadius.value))
        for wheel, power in zip(self._wheels, wanted, strict=True):
            wheel.servo.run_at(round(power * turns), origin)

    def check_motors(self) -> None:
        """Raise ValueError while the link is down, or if a wheel has lost its motor."""
        if not self._robot.arrival.is_up():
            raise ValueError("the link to the brick is down; wait until nxt.link is true")
        if len(self.devices) < len(self._wheels):
            raise ValueError("a wheel has no motor any more; call nxt.steer with the two that drive")

    def update_limits(self, limits: DriveLimits) -> None:
        """Set the limits by the speeds of the motors, the geometry and the limits of the settings."""
        settings = [self._robot.motor_limits(str(place)) for place in self.devices]
        rim = self._rim_speed()
        limits.fastest = rim * min(1.0, *(each.speed / FULL for each in settings))
        limits.slowest = min(limits.fastest, rim * CREEPING / FULL)
        limits.braking = min(BRAKING, *(rim * each.acceleration / FULL for each in settings))
        # A wheel's rim turns the robot on a circle of half the track.
        turns = 2 / float(self._robot.track.value)
        limits.fastest_turn, limits.slowest_turn = limits.fastest * turns, limits.slowest * turns
        limits.braking_turn = limits.braking * turns

    def obstacles(self) -> list[Point]:
        """Return the echo of the forward sensor as a point straight ahead of it; [] without an echo."""
        if self._ahead is None:
            return []
        sensor, place = self._ahead
        distance = float(sensor.distance.sensed)
        return [(place + distance, 0.0)] if not sensor.stale.sensed and math.isfinite(distance) else []

    def _rim_speed(self) -> float:
        """Return the speed of a wheel's rim at full speed, m/s."""
        return float(self._robot.fullSpeed.value) * abs(float(self._robot.wheelRadius.value))
