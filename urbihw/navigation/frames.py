"""Points and poses on the plane, (x, y) and (x, y, heading) in m and rad, and the arithmetic of frames."""

from __future__ import annotations

import math

Point = tuple[float, float]
Pose = tuple[float, float, float]
ORIGIN: Pose = (0.0, 0.0, 0.0)


def wrapped(angle: float) -> float:
    """An angle from -pi up to pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def compose(frame: Pose, pose: Pose) -> Pose:
    """A pose that is known in a frame, where the frame itself is known."""
    x, y, heading = frame
    c, s = math.cos(heading), math.sin(heading)
    return (x + c * pose[0] - s * pose[1], y + s * pose[0] + c * pose[1], wrapped(heading + pose[2]))


def frame_of(outside: Pose, inside: Pose) -> Pose:
    """The frame in which ``inside`` is the pose that is ``outside`` of it: compose(frame, inside) == outside."""
    heading = wrapped(outside[2] - inside[2])
    c, s = math.cos(heading), math.sin(heading)
    return (outside[0] - c * inside[0] + s * inside[1], outside[1] - s * inside[0] - c * inside[1], heading)
