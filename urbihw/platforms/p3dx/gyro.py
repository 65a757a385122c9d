"""The analog gyro of a Pioneer: its packets as rad/s, and the angle for the odometry.

Wheels that slip turn the odometry with them; a gyro does not notice slip, but its rest value drifts.  While the wheels
stand still, the readings correct the rest value; while they turn, the gyro gives the heading of the odometry (the
zero-velocity update of inertial navigation).  Sources: ARIA (``ArAnalogGyro.cpp``) for the scale.
"""

from __future__ import annotations

import math
from typing import Final

from urbihw.kernel.uobject import UObject, reading
from urbihw.platforms.p3dx import words

REST: Final = 512.0
"""The reading at rest before any was averaged."""
SCALE: Final = math.radians(5 / 1023 * 300 / 2.5 * 1.626)
"""rad/s per count; the count falls while the robot turns to the left."""
TIMEOUT_S: Final = 0.35
"""Seconds without a packet after which the wheels give the heading: three cycles."""
_SHARE: Final = 0.05
"""Weight of one reading at rest in the average."""
_DRIFT_MOST: Final = 30.0
"""Counts; a reading at rest farther from ``REST`` is no drift: the robot is being turned by somebody."""

HOST_READS: Final = 1
"""GYROTYPE of a gyro that only reports (UNCONFIRMED: others are already part of the controller's own heading)."""


class P3dxGyro(UObject):
    """How fast the robot turns, rad/s to the left, measured without the wheels."""

    slot_words = words.GYRO

    speed = reading(math.nan)
    temperature = reading(math.nan)

    def init(self) -> None:
        """No packet has come yet."""
        self._rest = REST
        self._angle = 0.0
        self._stamp = -math.inf

    def add_packet(self, rate: float, temperature: float, stamp: float, *, still: bool) -> None:
        """Process a packet; ``still``: the wheels stand still."""
        if still and abs(rate - REST) < _DRIFT_MOST:
            self._rest += _SHARE * (rate - self._rest)
        speed = (self._rest - rate) * SCALE
        seconds = stamp - self._stamp
        if not still and seconds < TIMEOUT_S:
            self._angle += speed * seconds
        self._stamp = stamp
        self.speed.sense(0.0 if still else speed, stamp)
        self.temperature.sense(float(temperature), stamp)

    def take_angle(self, stamp: float) -> float | None:
        """Return the angle in rad since the last call; None if no packet came within TIMEOUT_S."""
        angle, self._angle = self._angle, 0.0
        return angle if stamp - self._stamp < TIMEOUT_S else None

    def restart(self) -> None:
        """The link is down: nothing is known of the time until the next packet."""
        self._angle, self._stamp = 0.0, -math.inf
        self.speed.sense(math.nan)
