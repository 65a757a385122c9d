"""What a robot has that ROS knows, from its overview (``System.overviewText``)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple


class RangePart(NamedTuple):
    """A sensor of distance: its slot, its range in m, 0 to infinity where it is not known."""

    slot: str
    least: float
    most: float

    @property
    def name(self) -> str:
        """The name of the device."""
        return self.slot.rpartition(".")[0]


class RosParts(NamedTuple):
    """The slots of a robot.

    Attributes:
        name: that of the robot.
        joints: the names of the joints, in their order.
        drives: whether it is a base that drives.
        accelerations, turns: slots of an inertial sensor, by the letter of the axis.
        laser, battery, camera: names of devices, "" for none.
    """

    name: str
    joints: tuple[str, ...]
    drives: bool
    ranges: tuple[RangePart, ...]
    accelerations: tuple[tuple[str, str], ...]
    turns: tuple[tuple[str, str], ...]
    laser: str
    battery: str
    camera: str


def parts_of(overview: Mapping[str, Any], joints: list[str]) -> RosParts:
    """The parts in an overview."""
    rows = [*overview.get("effectors", ()), *overview.get("sensors", ())]

    def slots(role: str) -> list[Mapping[str, Any]]:
        return [row for row in rows if row.get("role") == role]

    def device(role: str) -> str:
        return next((str(row["slot"]).rpartition(".")[0] for row in slots(role)), "")

    return RosParts(
        str(overview.get("robot", "")),
        tuple(joints),
        any(row["slot"] == "robot.xSpeed" for row in slots("base")),
        tuple(RangePart(row["slot"], row.get("min", 0.0), row.get("max", math.inf)) for row in slots("distance")
              if row.get("unit") == "m"),
        _axes(slots("acceleration")),
        _axes(slots("gyro")),
        device("laser"), device("battery"), device("camera"),
    )  # fmt: skip


def _axes(rows: list[Mapping[str, Any]]) -> tuple[tuple[str, str], ...]:
    """The axis, x, y or z, and the slot of each sensor whose name ends with the axis, such as ``accelX``."""
    named = ((str(row["slot"]).rpartition(".")[0][-1:].lower(), str(row["slot"])) for row in rows)
    return tuple((axis, slot) for axis, slot in named if axis in "xyz")
