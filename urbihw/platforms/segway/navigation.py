"""The planner and the odometry of a Segway, for ``urbihw.navigation``.

The odometry uses the base's counters (``forward``, ``yaw``) with the coefficients of one RMP, and speeds are commanded
with the coefficients of the same RMP: a calibration of ``rmp.forwardCoeff`` applies to the planner too.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Final, Protocol

from urbihw.kernel.uobject import Origin
from urbihw.navigation.drive import DriveLimits
from urbihw.navigation.frames import Point
from urbihw.navigation.navigator import Navigator
from urbihw.navigation.odometry import Odometry
from urbihw.platforms.limits import DeviceLimits
from urbihw.platforms.segway.options import SegwayOptions
from urbihw.platforms.segway.rmp import BASE, RMP

BRAKING: Final = 0.5
BRAKING_TURN: Final = 1.5
"""Deceleration assumed by the planner at ``accelerationScale`` 1, m/s2 and rad/s2; a guess below the capability of the
base, so that a balancing body leans little."""
LEAST_SCALE: Final = 0.1
"""Smallest share of that, for any ``accelerationScale``."""


class SegwayOdometry(Odometry):
    """``segway.odometry``"""


class SegwayPlanner(Navigator):
    """``segway.planner``"""

    slot_name = "segway.planner"


class SegwayCarriage(Protocol):
    """The part of the robot that the planner uses."""

    options: SegwayOptions

    def set_target(self, item: str, counts: int, origin: Origin) -> None:
        """Send a speed with the next command."""
        ...

    def base_limits(self) -> DeviceLimits:
        """The limits of the settings for the base."""
        ...


class SegwayWheels:
    """The base with one RMP, as ``navigation.pilot.Wheels``."""

    devices: tuple[Hashable, ...] = (BASE,)

    def __init__(self, robot: SegwayCarriage, rmp: RMP) -> None:
        """``rmp`` has the counters and the coefficients."""
        self.rmp = rmp
        self._robot = robot

    @property
    def navigation(self) -> SegwayOptions:
        """The settings of the robot for navigation."""
        return self._robot.options

    def order_speeds(self, v: float, w: float, origin: Origin) -> None:
        """Drive at these speeds, m/s and rad/s, by the coefficients of the RMP."""
        for item, counts in self.rmp.speeds_in_counts(v, w).items():
            self._robot.set_target(item, counts, origin)

    def check_motors(self) -> None:
        """Raise ValueError while the base is lost, does not report its counters, or has its motors off."""
        if self.rmp.state.sensed != "ok":
            raise ValueError('the base is lost; wait until segway.state is "ok"')
        self.rmp.check_way()
        if off := self.rmp.explain_off():
            raise ValueError(off)

    def update_limits(self, limits: DriveLimits) -> None:
        """Set the limits by the ranges of the slots and the limits of the settings."""
        rmp, settings = self.rmp, self._robot.base_limits()
        scale = max(LEAST_SCALE, float(rmp.accelerationScale.sensed))
        limits.fastest = min(float(rmp.forwardSpeed.get_property("rangemax")), settings.speed)
        limits.fastest_turn = min(float(rmp.yawSpeed.get_property("rangemax")), settings.turn)
        limits.braking = min(BRAKING * scale, settings.acceleration)
        limits.braking_turn = BRAKING_TURN * scale

    def obstacles(self) -> list[Point]:
        """Return no obstacles: the base has no such sensors."""
        return []
