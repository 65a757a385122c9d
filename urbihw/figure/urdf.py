"""A figure as URDF, the format of ROS, PyBullet, Pinocchio and viewers (http://wiki.ros.org/urdf/XML).

URDF has no capsules and ellipsoids: a capsule becomes a cylinder with a sphere at either end, an ellipsoid the sphere
of the same volume.  A joint has no offset there: its zero is the drawn pose.  Nothing is said of masses.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree import ElementTree as xml

from urbihw.figure.model import UNITS, Figure, FigureJoint, FigureLink, FigureShape, Triple
from urbihw.figure.pose import at

EFFORT, VELOCITY = 10.0, 10.0
"""What a URDF must say of a joint with limits, and a figure does not know: N m or N, rad/s or m/s."""


def to_urdf(figure: Figure, name: str) -> str:
    """The text of the URDF of a robot of this name; a first link ``robot`` is the frame of the robot on the floor."""
    root = xml.Element("robot", name=name)
    xml.SubElement(root, "link", name=_frame_name(figure))
    for link in figure.links:
        made = xml.SubElement(root, "link", name=link.name)
        for shape in link.shapes:
            for kind in ("visual", "collision"):
                for piece in _pieces(shape):
                    _solid(made, kind, piece)
    for link in figure.links:
        _joint(root, link, link.on or _frame_name(figure))
    xml.indent(root)
    return '<?xml version="1.0"?>\n' + xml.tostring(root, encoding="unicode") + "\n"


def _frame_name(figure: Figure) -> str:
    names = {link.name for link in figure.links}
    return "robot" if "robot" not in names else "robot_frame"


def _joint(root: xml.Element, link: FigureLink, above: str) -> None:
    joint = link.joint
    kind = "fixed"
    if joint is not None:
        kind = "prismatic" if joint.unit == "m" else "revolute" if math.isfinite(joint.low) else "continuous"
    name = f"{link.name}_mount" if joint is None else joint.device or link.name
    made = xml.SubElement(root, "joint", name=name, type=kind)
    xml.SubElement(made, "parent", link=above)
    xml.SubElement(made, "child", link=link.name)
    _origin(made, link.at, link.turn)
    if joint is not None:
        xml.SubElement(made, "axis", xyz=_numbers(joint.axis))
        if kind != "continuous":
            xml.SubElement(made, "limit", _limits(joint))


def _limits(joint: FigureJoint) -> dict[str, str]:
    low, high = (_number((end - joint.zero) * UNITS[joint.unit]) for end in (joint.low, joint.high))
    return {"lower": low, "upper": high, "effort": _number(EFFORT), "velocity": _number(VELOCITY)}


def _pieces(shape: FigureShape) -> Iterator[FigureShape]:
    if shape.kind == "capsule":
        radius, length = shape.sizes
        yield FigureShape("cylinder", shape.sizes, shape.at, shape.turn, shape.colour)
        pose = at(shape.at, shape.turn)
        for end in (-length / 2, length / 2):
            yield FigureShape("sphere", (radius,), pose.point((0.0, 0.0, end)), colour=shape.colour)
    elif shape.kind == "ellipsoid":
        yield FigureShape("sphere", (math.prod(shape.sizes) ** (1 / 3),), shape.at, colour=shape.colour)
    else:
        yield shape


def _solid(link: xml.Element, kind: str, shape: FigureShape) -> None:
    made = xml.SubElement(link, kind)
    _origin(made, shape.at, shape.turn)
    geometry = xml.SubElement(made, "geometry")
    if shape.kind == "box":
        xml.SubElement(geometry, "box", size=_numbers(shape.sizes))
    elif shape.kind == "sphere":
        xml.SubElement(geometry, "sphere", radius=_number(shape.sizes[0]))
    else:
        radius, length = shape.sizes
        xml.SubElement(geometry, "cylinder", radius=_number(radius), length=_number(length))
    if kind == "visual":
        material = xml.SubElement(made, "material", name=shape.colour)
        shares = [int(shape.colour[index : index + 2], 16) / 255 for index in (1, 3, 5)]
        xml.SubElement(material, "color", rgba=_numbers((*shares, 1.0)))


def _origin(made: xml.Element, place: Triple, turn: Triple) -> None:
    xml.SubElement(made, "origin", xyz=_numbers(place), rpy=_numbers(turn))


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(map(_number, values))


def _number(value: float) -> str:
    return f"{value:.6g}"
