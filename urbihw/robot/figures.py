"""Figure: links, joints and shapes of a robot, and where its parts are.  Not in the manual.

The object of the platform tells the figure (``figureText``); it holds for a robot that has all of its joints.  For any
other one, and for a platform without a figure, the joints are drawn on a bench.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import lru_cache
from typing import Final

from urbihw.figure import Figure, FigureLink
from urbihw.figure.bench import bench
from urbihw.figure.kinematics import place_of
from urbihw.figure.model import parse
from urbihw.kernel.library import Obj, String, Table, Value, World, docstrings_of, errors, find_property
from urbihw.robot.overview import joints_of, parts_of
from urbihw.robot.tree_walk import DeviceSlot, platform_of

PROTOS = {"Figure": ("Object",)}
TABLE = Table("System")
DRAWN: Final = "figureText"
"""The function of a platform's object that tells the figure as JSON, "" for none."""


@TABLE.primitive("figureText")
def figure_text(world: World, this: Value, robot: Obj) -> str:
    """The figure of a robot as a text of JSON: links, their joints and shapes, with the names that devices have in the
    tree."""
    return json.dumps(_as_in_tree(world, robot, _figure(world, robot)).as_table(), separators=(",", ":"))


@TABLE.primitive("figureLinks")
def figure_links(world: World, this: Value, robot: Obj) -> Value:
    """The names of the links of the figure of a robot, each behind the one that carries it."""
    return world.new_list([world.string(link.name) for link in _figure(world, robot).links])


@TABLE.primitive("linkPose")
def link_pose(world: World, this: Value, robot: Obj, link: str) -> Value:
    """Where a link of the figure is, by the measured joints: a List of x, y, z, roll, pitch and yaw in the frame of the
    robot."""
    figure = _figure(world, robot)
    chain = _chain(figure, link)
    devices = [each.joint.device for each in chain if each.joint is not None and each.joint.device]
    pose = place_of(figure, link, {device: _reading(world, device) for device in devices})
    return world.new_list([*pose.place, *pose.turn])


@TABLE.primitive("linkJoints")
def link_joints(world: World, this: Value, robot: Obj, link: str) -> Value:
    """The joints that move a link of the figure: for each a List of its name, its reading, and the least and the
    greatest reading that its figure and the device allow."""
    moving = {id(each.part) for each in joints_of(world, robot)}
    rows = []
    for each in _chain(_figure(world, robot), link):
        joint = each.joint
        held = None if joint is None else world.global_.slots.get(joint.device)
        if joint is not None and isinstance(held, Obj) and id(held) in moving:
            _, low, high = _range(world, held)
            row = [_reading(world, joint.device), max(low, joint.low), min(high, joint.high)]
            rows.append(world.new_list([world.string(joint.device), *row]))
    return world.new_list(rows)


def _chain(figure: Figure, link: str) -> list[FigureLink]:
    """The links from the first one to this one.  Raises an urbiscript error for an unknown one."""
    try:
        return figure.chain(link)
    except KeyError:
        message = f'the figure has no link "{link}"; robot.figure.links has them'
        raise errors.primitive(message, "linkPose") from None


def _figure(world: World, robot: Obj) -> Figure:
    """The figure that the platform tells, for a robot that has its joints; else these joints on a bench."""
    text = _told(world, robot)
    if text:
        drawn = _parsed(text)
        if all(device in world.global_.slots for device in drawn.devices):
            return drawn
    return bench({each.name: _range(world, each.part) for each in joints_of(world, robot)})


def _told(world: World, robot: Obj) -> str:
    owner = platform_of(robot)
    holder = None if owner is None else owner.find(DRAWN)
    told = None if owner is None or holder is None else world.invoke(holder.slots[DRAWN], owner, ())
    return told.s if isinstance(told, String) else ""


@lru_cache(maxsize=4)
def _parsed(text: str) -> Figure:
    return parse(json.loads(text))


def _range(world: World, joint: Obj) -> tuple[str, float, float]:
    """The unit of a joint's reading, and its least and greatest one."""
    ends = [find_property(joint, "val", end) for end in ("rangemin", "rangemax")]
    low, high = (end if end.__class__ is float else math.nan for end in ends)
    is_bounded = low < high and math.isfinite(high - low)
    unit = docstrings_of(world).unit(joint, "val")
    return (unit, low, high) if is_bounded else (unit, -math.inf, math.inf)


def _reading(world: World, device: str) -> float:
    """What a joint measures."""
    held = world.global_.slots.get(device)
    content = DeviceSlot(world, held, "val").content() if isinstance(held, Obj) else None
    value = world.as_float(content, None, None) if content is not None else math.nan
    if not math.isfinite(value):
        raise errors.primitive(f"{device} has no reading", "linkPose")
    return value


def _as_in_tree(world: World, robot: Obj, figure: Figure) -> Figure:
    """The figure with the names by which the tree calls the devices; one that is not in the tree has none."""
    names = {id(each.part): each.name for each in parts_of(world, robot)}

    def named(device: str) -> str:
        return names.get(id(world.global_.slots.get(device)), "")

    def renamed(link: FigureLink) -> FigureLink:
        joint = None if link.joint is None else replace(link.joint, device=named(link.joint.device))
        return replace(link, joint=joint, device=named(link.device))

    return Figure(tuple(map(renamed, figure.links)))
