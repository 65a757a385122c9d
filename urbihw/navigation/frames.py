"""Points and poses on the plane, (x, y) and (x, y, heading) in m and rad, and the arithmetic of frames."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

Point = tuple[float, float]
Pose = tuple[float, float, float]
ORIGIN: Pose = (0.0, 0.0, 0.0)
MAX_METRES: Final = 10_000.0
"""Greatest coordinate of a map and of a pose on it."""
_STRAIGHT = 1e-6
"""rad; an arc of less is as long as its chord."""


def wrapped(angle: float) -> float:
    """An angle from -pi up to pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def path_length(path: Sequence[Point]) -> float:
    """Length in m of the straight lines between some points."""
    return sum(math.dist(a, b) for a, b in zip(path, path[1:], strict=False))


def compose(frame: Pose, pose: Pose) -> Pose:
    """Transform a pose in ``frame`` to the frame in which ``frame`` itself is given."""
    x, y, heading = frame
    c, s = math.cos(heading), math.sin(heading)
    return (x + c * pose[0] - s * pose[1], y + s * pose[0] + c * pose[1], wrapped(heading + pose[2]))


def moved(pose: Pose, way: float, angle: float) -> Pose:
    """The pose after ``way`` m and a turn by ``angle`` rad at constant speeds, which is an arc."""
    half = angle / 2
    # The direction of the chord is half way between the two headings.
    chord = way * math.sin(half) / half if abs(half) > _STRAIGHT else way
    x, y, heading = pose
    middle = heading + half
    return (x + chord * math.cos(middle), y + chord * math.sin(middle), wrapped(heading + angle))


def share_of(a: Pose, b: Pose, share: float) -> Pose:
    """The pose at a share of the way from a to b; beyond b for more than 1."""
    return a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share, wrapped(a[2] + wrapped(b[2] - a[2]) * share)


def frame_of(outside: Pose, inside: Pose) -> Pose:
    """The frame for which compose(frame, inside) == outside."""
    heading = wrapped(outside[2] - inside[2])
    c, s = math.cos(heading), math.sin(heading)
    return (outside[0] - c * inside[0] + s * inside[1], outside[1] - s * inside[0] - c * inside[1], heading)


def distance_to_line(point: Point, a: Point, b: Point) -> float:
    """Distance of a point from a line between two others."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    share = max(0.0, min(1.0, ((point[0] - a[0]) * dx + (point[1] - a[1]) * dy) / square)) if square else 0.0
    return math.dist(point, (a[0] + share * dx, a[1] + share * dy))
