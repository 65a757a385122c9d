"""How well the pose of a base is known between two scans: a covariance that grows with the way and shrinks with each
scan, in the directions of which the scan tells something; no I/O.

Without it, scans of moved furniture between two long walls would push the pose along these walls to where the furniture
once was.  This is the extended Kalman filter of Thrun, Burgard, Fox: Probabilistic Robotics (2005), table 7.2, for a
pose whose measurement is the least squares of a whole scan.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from urbihw.navigation.frames import Pose, wrapped

PLACED, PLACED_TURN = 0.2, 0.15
"""m and rad by which a pose may be off that somebody has told."""
SLIP, SLIP_ASIDE, SLIP_TURN = 0.1, 0.05, 0.1
"""Error of the wheels per m ahead, m aside and rad; and per rad of a turn, rad."""
DRIFT, DRIFT_TURN = 0.004, 0.004
"""m and rad beside that, from scan to scan."""
MOVED = 1e-3
"""m or rad from which the base has moved."""
LEAST, LEAST_TURN = 0.006, 0.006
"""m and rad below which no pose counts as known, as the readings of a scan err together."""


class Symmetric(NamedTuple):
    """A symmetric matrix of three rows for x, y and the heading t."""

    xx: float
    yy: float
    tt: float
    xy: float = 0.0
    xt: float = 0.0
    yt: float = 0.0

    def __add__(self, other: Symmetric) -> Symmetric:  # type: ignore[override]
        return Symmetric(*(a + b for a, b in zip(self, other, strict=True)))

    def inverse(self) -> Symmetric:
        """The inverse; the matrix must be positive definite."""
        xx, yy, tt, xy, xt, yt = self
        a, b, c = yy * tt - yt * yt, xt * yt - xy * tt, xy * yt - xt * yy
        whole = xx * a + xy * b + xt * c
        return Symmetric(
            a / whole, (xx * tt - xt * xt) / whole, (xx * yy - xy * xy) / whole, b / whole, c / whole,
            (xy * xt - xx * yt) / whole,
        )  # fmt: skip

    def times(self, x: float, y: float, t: float) -> Pose:
        """The product with a vector."""
        return (
            self.xx * x + self.xy * y + self.xt * t, self.xy * x + self.yy * y + self.yt * t,
            self.xt * x + self.yt * y + self.tt * t,
        )  # fmt: skip


class Belief:
    """The covariance of the pose, in the frame of the map.

    Attributes:
        has_moved: the wheels have turned since the scan before.
    """

    def __init__(self) -> None:
        self._spread = Symmetric(PLACED**2, PLACED**2, PLACED_TURN**2)
        self._last: Pose | None = None
        self.has_moved = False

    def move(self, pose: Pose) -> None:
        """The wheels say that the base has moved to a pose since ``measure``."""
        last, self._last = self._last or pose, pose
        dx, dy, turn = pose[0] - last[0], pose[1] - last[1], abs(wrapped(pose[2] - last[2]))
        self.has_moved = math.hypot(dx, dy) > MOVED or turn > MOVED
        xx, yy, tt, xy, xt, yt = self._spread
        # An error of the heading is one of the place after a way.
        moved = Symmetric(
            xx - 2 * dy * xt + dy * dy * tt, yy + 2 * dx * yt + dx * dx * tt, tt,
            xy + dx * xt - dy * yt - dx * dy * tt, xt - dy * tt, yt + dx * tt,
        )  # fmt: skip
        way = math.hypot(dx, dy)
        along, aside = (SLIP * way) ** 2 + DRIFT**2, (SLIP_ASIDE * way) ** 2 + DRIFT**2
        c, s = math.cos(pose[2]), math.sin(pose[2])
        self._spread = moved + Symmetric(
            along * c * c + aside * s * s, along * s * s + aside * c * c,
            (SLIP_TURN * (way + turn)) ** 2 + DRIFT_TURN**2, (along - aside) * c * s,
        )  # fmt: skip

    def information(self) -> Symmetric:
        """The inverse of the covariance, before a scan is matched."""
        return self._spread.inverse()

    @property
    def spread(self) -> float:
        """Standard deviation of the place in m, in its worst direction at most."""
        return math.sqrt(self._spread.xx + self._spread.yy)

    def measure(self, pose: Pose, information: Symmetric) -> None:
        """A scan has put the base at a pose; ``information`` is that of the scan and of the belief before."""
        self._spread = information.inverse() + Symmetric(LEAST**2, LEAST**2, LEAST_TURN**2)
        self._last = pose
