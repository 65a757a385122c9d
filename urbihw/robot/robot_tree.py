"""System.tree: what a robot has, as data for programs that build a panel from it.  Not in the manual.

docs/telemetry.md describes it.
"""

from __future__ import annotations

import json
import zlib
from typing import Any

from urbihw.kernel.library import GroupObject, Obj, Table, Value, World
from urbihw.robot.localizer import LocalizerObject
from urbihw.robot.overview import joints_of
from urbihw.robot.tree_walk import Node, TreeWalk, class_name, platform_of

TABLE = Table("System")


def make_tree(world: World, robot: Obj) -> Node:
    """A robot: its parts (``robot``), the object of its platform (``platform``), groups of its devices, and the paths
    of its joints in their order."""
    walk = TreeWalk(world, True)
    name = world.global_name(robot) or "robot"
    made: Node = {"robot": walk.node(robot, name, name, None), "platform": None, "groups": []}
    owner = platform_of(robot)
    if owner is not None:
        title = world.global_name(owner) or ""
        made["platform"] = {"name": title, "path": title, "class": class_name(owner), "slots": walk.slots(owner)}
    for title, value in sorted(world.global_.slots.items()):
        members = _members(world, value)
        if members and value is not robot and all(id(part) in walk.paths for part in members):
            made["groups"].append({"name": title, "members": [walk.paths[id(part)] for part in members]})
    made["joints"] = [joint.path for joint in joints_of(world, robot)]
    return made


def _members(world: World, value: Value) -> list[Obj]:
    """The devices of a group or of a Localizer; empty for anything else."""
    if isinstance(value, LocalizerObject):
        found: list[Obj] = []
        for _, part in value.parts:
            found += _members(world, part) or [part]
        return found
    return [part for part in value.members if isinstance(part, Obj)] if isinstance(value, GroupObject) else []


@TABLE.primitive("tree")
def tree(world: World, this: Value, robot: Obj) -> Value:
    """What a robot has, as Dictionaries and Lists: its parts with interfaces, slots, units and ranges, the object of
    its platform, and groups."""
    return _to_urbiscript(world, make_tree(world, robot))


@TABLE.primitive("treeText")
def tree_text(world: World, this: Value, robot: Obj) -> str:
    """The same as ``tree``, as a text of JSON."""
    return json.dumps(make_tree(world, robot), separators=(",", ":"))


@TABLE.primitive("treeKey")
def tree_key(world: World, this: Value, robot: Obj) -> str:
    """A short text that changes when parts come or go, or change their interfaces; much cheaper than ``tree``."""
    name = world.global_name(robot) or "robot"
    return f"{zlib.crc32(json.dumps(TreeWalk(world, False).node(robot, name, name, None)).encode()):08x}"


def _to_urbiscript(world: World, value: Any) -> Value:
    """The urbiscript value of a part of a tree; nil for None."""
    if value is None:
        return world.nil
    if isinstance(value, list):
        return world.new_list([_to_urbiscript(world, member) for member in value])
    if isinstance(value, dict):
        return world.dictionary({key: _to_urbiscript(world, member) for key, member in value.items()})
    return world.from_python(value)
