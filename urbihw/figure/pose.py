"""Places and turns of rigid bodies, in plain Python: a figure has some twenty links, which need no array library."""

from __future__ import annotations

import math
from typing import NamedTuple

Triple = tuple[float, float, float]
Rows = tuple[Triple, Triple, Triple]
_STRAIGHT: Rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_GIMBAL = 1.0 - 1e-9
"""Sine of a pitch at which roll and yaw are one angle."""


class Pose(NamedTuple):
    """Where a frame is in another one.

    Attributes:
        place: its origin, m.
        rows: the rows of its rotation matrix.
    """

    place: Triple = (0.0, 0.0, 0.0)
    rows: Rows = _STRAIGHT

    def then(self, inner: Pose) -> Pose:
        """The place of a frame that is at ``inner`` in this one."""
        columns = tuple(zip(*inner.rows, strict=True))
        rows = tuple(tuple(_dot(row, column) for column in columns) for row in self.rows)
        return Pose(self.point(inner.place), rows)  # type: ignore[arg-type]

    def point(self, point: Triple) -> Triple:
        """Where a point of this frame is in the other one, m."""
        return tuple(  # type: ignore[return-value]
            own + _dot(row, point) for own, row in zip(self.place, self.rows, strict=True)
        )

    @property
    def turn(self) -> Triple:
        """Roll, pitch and yaw, rad; the roll is 0 where the pitch is a right angle."""
        (a, b, _), (c, d, _), (sine, e, f) = self.rows
        if abs(sine) > _GIMBAL:
            return 0.0, math.copysign(math.pi / 2, -sine), math.atan2(-b, d)
        return math.atan2(e, f), math.asin(-sine), math.atan2(c, a)


def at(place: Triple, turn: Triple = (0.0, 0.0, 0.0)) -> Pose:
    """A pose by place and by roll, pitch and yaw."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(angle), math.cos(angle)) for angle in turn)
    return Pose(place, (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    ))  # fmt: skip


def turned(axis: Triple, angle: float) -> Pose:
    """A turn about an axis of length 1, to the left when the axis points at the eye."""
    x, y, z = axis
    sine, cosine = math.sin(angle), math.cos(angle)
    rest = 1.0 - cosine
    return Pose((0.0, 0.0, 0.0), (
        (cosine + x * x * rest, x * y * rest - z * sine, x * z * rest + y * sine),
        (y * x * rest + z * sine, cosine + y * y * rest, y * z * rest - x * sine),
        (z * x * rest - y * sine, z * y * rest + x * sine, cosine + z * z * rest),
    ))  # fmt: skip


def _dot(one: tuple[float, ...], other: tuple[float, ...]) -> float:
    return sum(a * b for a, b in zip(one, other, strict=True))
