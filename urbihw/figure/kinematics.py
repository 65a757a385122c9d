"""Where the links of a figure are (forward kinematics)."""

from __future__ import annotations

from collections.abc import Mapping

from urbihw.figure.model import Figure, FigureJoint, FigureLink
from urbihw.figure.pose import Pose, at, turned


def place_of(figure: Figure, name: str, readings: Mapping[str, float]) -> Pose:
    """Where a link is in the frame of the robot; ``readings`` as in ``places``.  Raises KeyError for an unknown one."""
    pose = Pose()
    for link in figure.chain(name):
        pose = pose.then(_own(link, readings))
    return pose


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
