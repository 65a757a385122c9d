"""Where the links of a figure are (forward kinematics)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from urbihw.figure.model import UNITS, Figure, FigureJoint, FigureLink, Triple
from urbihw.figure.pose import Pose, at, turned


def place_of(figure: Figure, name: str, readings: Mapping[str, float]) -> Pose:
    """Where a link is in the frame of the robot; ``readings`` as in ``places``.  Raises KeyError for an unknown one."""
    return frames(figure, name, readings)[-1][1]


def frames(figure: Figure, name: str, readings: Mapping[str, float]) -> list[tuple[FigureLink, Pose]]:
    """The links from the first one to this one, each with its place in the frame of the robot.  Raises KeyError."""
    found: list[tuple[FigureLink, Pose]] = []
    pose = Pose()
    for link in figure.chain(name):
        pose = pose.then(_own(link, readings))
        found.append((link, pose))
    return found


def ways_of(chain: Sequence[tuple[FigureLink, Pose]], point: Triple) -> dict[str, Triple]:
    """How a point of the last link moves, m, for one unit of each reading: a column of the Jacobian for each device."""
    ways: dict[str, Triple] = {}
    for link, pose in chain:
        joint = link.joint
        if joint is None or not joint.device:
            continue
        axis = Pose(rows=pose.rows).point(joint.axis)
        arm = tuple(end - own for end, own in zip(point, pose.place, strict=True))
        x, y, z = axis if joint.unit == "m" else _cross(axis, (arm[0], arm[1], arm[2]))
        size = UNITS[joint.unit]
        ways[joint.device] = (x * size, y * size, z * size)
    return ways


def _cross(one: Triple, other: Triple) -> Triple:
    (a, b, c), (x, y, z) = one, other
    return b * z - c * y, c * x - a * z, a * y - b * x


def places(figure: Figure, readings: Mapping[str, float]) -> dict[str, Pose]:
    """Where all links are in the frame of the robot.

    ``readings`` are those of the devices, by their names and in their own units; a joint without one is as drawn.
    """
    found: dict[str, Pose] = {}
    for link in figure.links:
        above = found[link.on] if link.on else Pose()
        found[link.name] = above.then(_own(link, readings))
    return found


def _own(link: FigureLink, readings: Mapping[str, float]) -> Pose:
    """Where a link is in the one above it."""
    fixed = at(link.at, link.turn)
    if link.joint is None or link.joint.device not in readings:
        return fixed
    return fixed.then(_moved(link.joint, link.joint.travel(readings[link.joint.device])))


def _moved(joint: FigureJoint, travel: float) -> Pose:
    if joint.unit == "m":
        x, y, z = joint.axis
        return Pose((x * travel, y * travel, z * travel))
    return turned(joint.axis, travel)
