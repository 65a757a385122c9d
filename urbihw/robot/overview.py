"""System.jointNames and System.overviewText: what moves and what measures, for programs.  Not in the manual.

``System.tree`` tells everything, which is 80 kB for an arm; a program that moves joints and reads sensors needs the
names of their slots, in an order that stays the same.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from urbihw.kernel.library import (
    Executable,
    List,
    Obj,
    String,
    Table,
    Value,
    World,
    docstrings_of,
    find_property,
)
from urbihw.robot.tree_walk import DeviceSlot, Node, TreeWalk, platform_of

TABLE = Table("System")

DIGITS: Final = 4
"""Digits behind the point of a range."""
JOINT: Final = "joint"
WHEEL: Final = "wheel"
_WHEELS: Final = ("wheel", "track")
"""Names of parts, by the naming standard, that turn for ever although they have an angle."""
ORDER: Final = "jointOrder"
"""The function of a platform's object that returns its joints in their order."""
_EFFECTORS: Final = {
    "RotationalMotor": (JOINT, ("val",)), "LinearMotor": (JOINT, ("val",)),
    "RotationalSpeedMotor": (WHEEL, ("val",)), "LinearSpeedMotor": (WHEEL, ("val",)),
    "Motor": ("motor", ("val",)), "Mobile": ("base", ("xSpeed", "ySpeed", "yawSpeed")), "Led": ("light", ("val",)),
    "RGBLed": ("light", ("r", "g", "b")), "AudioOut": ("speaker", ("val",)),
}  # fmt: skip
"""Interface -> role of the device, and the slots that are written."""
_SENSORS: Final = {
    "Sensor": ("sensor", ("val",)), "DistanceSensor": ("distance", ("val",)), "TouchSensor": ("touch", ("val",)),
    "AccelerationSensor": ("acceleration", ("val",)), "GyroSensor": ("gyro", ("val",)),
    "TemperatureSensor": ("temperature", ("val",)), "Laser": ("laser", ("val",)), "VideoIn": ("camera", ("val",)),
    "AudioIn": ("microphone", ("val",)), "Battery": ("battery", ("remain", "voltage")),
    "Tracker": ("tracker", ("yaw", "pitch")),
}  # fmt: skip
"""Interface -> role of the device, and the slots that are read."""


class PartInTree(NamedTuple):
    """A part of the tree: the name by which programs call it, its name in the tree, its path, its object, its
    interfaces."""

    name: str
    kind: str
    path: str
    part: Obj
    interfaces: list[str]


def parts_of(world: World, robot: Obj) -> Iterator[PartInTree]:
    """The robot and its parts, in the order of the tree."""
    walk = TreeWalk(world, False)
    name = world.global_name(robot) or "robot"
    waiting = [walk.node(robot, name, name, None)]
    while waiting:
        node: Node = waiting.pop(0)
        path = node["path"]
        yield PartInTree(node["global"] or path, node["name"], path, walk.parts[path], node["interfaces"])
        waiting[:0] = node["parts"]


def joints_of(world: World, robot: Obj) -> list[PartInTree]:
    """The joints: parts that go to a written position, but for wheels.  They are in the order that the object of the
    platform has for them, and others behind these in that of the tree."""
    found = [each for each in parts_of(world, robot) if _slots(world, each, _EFFECTORS, JOINT)]
    ranks = {id(joint): rank for rank, joint in enumerate(_ordered(world, robot))}
    return sorted(found, key=lambda each: ranks.get(id(each.part), len(ranks)))


def _ordered(world: World, robot: Obj) -> list[Value]:
    owner = platform_of(robot)
    holder = None if owner is None else owner.find(ORDER)
    if holder is None or not isinstance(holder.slots[ORDER], Executable):
        return []
    told = world.invoke(holder.slots[ORDER], owner, ())
    return list(told.l) if isinstance(told, List) else []


def _slots(
    world: World, each: PartInTree, roles: dict[str, tuple[str, tuple[str, ...]]], only: str = ""
) -> list[tuple[str, str]]:
    """The role and the name of each slot of a part that has a role of a table."""
    found = []
    for interface in each.interfaces:
        role, names = roles.get(interface, ("", ()))
        if role == JOINT and each.kind in _WHEELS:
            role = WHEEL
        if role and only in ("", role):
            writes = roles is _EFFECTORS
            found += [(role, name) for name in names if _is_there(world, each.part, name, writes)]
    return found


def _is_there(world: World, part: Obj, name: str, writes: bool) -> bool:
    slot = DeviceSlot(world, part, name)
    if slot.value is None or slot.is_missing():
        return False
    return slot.is_writable() if writes else True


def make_overview(world: World, robot: Obj) -> dict[str, Any]:
    """The slots of a robot that move something, joints first, and those that measure."""
    joints = joints_of(world, robot)
    others = [each for each in parts_of(world, robot) if all(each.part is not joint.part for joint in joints)]
    return {
        "robot": _text(world, robot, "name"), "type": _text(world, robot, "type"),
        "effectors": _rows(world, [*joints, *others], _EFFECTORS), "sensors": _rows(world, others, _SENSORS),
    }  # fmt: skip


def _rows(
    world: World, parts: list[PartInTree], roles: dict[str, tuple[str, tuple[str, ...]]]
) -> list[dict[str, Any]]:
    return [_row(world, each, role, name) for each in parts for role, name in _slots(world, each, roles)]


def _row(world: World, each: PartInTree, role: str, name: str) -> dict[str, Any]:
    made: dict[str, Any] = {"slot": f"{each.name}.{name}", "role": role}
    if unit := docstrings_of(world).unit(each.part, name):
        made["unit"] = unit
    for key, end in (("min", "rangemin"), ("max", "rangemax")):
        bound = find_property(each.part, name, end)
        if bound.__class__ is float and abs(bound) < float("inf"):
            made[key] = round(bound, DIGITS)
    return made


def _text(world: World, robot: Obj, name: str) -> str:
    content = DeviceSlot(world, robot, name).content()
    return content.s if isinstance(content, String) else ""


@TABLE.primitive("jointNames")
def joint_names(world: World, this: Value, robot: Obj) -> Value:
    """The names of the joints of a robot, such as ``motor6``, as a List of Strings.  Their order stays the same: that
    of the settings, else that which the robot has for them."""
    return world.new_list([world.string(each.name) for each in joints_of(world, robot)])


@TABLE.primitive("overviewText")
def overview_text(world: World, this: Value, robot: Obj) -> str:
    """The slots that move something and those that measure, with their roles, units and ranges, as a text of JSON."""
    return json.dumps(make_overview(world, robot), separators=(",", ":"))
