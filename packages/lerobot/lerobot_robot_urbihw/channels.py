"""LeRobot's numbers and the slots behind them.

LeRobot has joints in degrees, grippers from 0 (least) to 100, bases in m/s and degrees a second; names are
``shoulder_pan.pos``, ``x.vel``, ``theta.vel``.  (Source: ``SOFollowerRobotConfig.use_degrees`` and ``LeKiwi`` of
lerobot 0.6.1.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from urbihw.client.robot import Robot

DEGREES: Final = {"rad": 180 / math.pi, "deg": 1.0, "turn": 360.0, "rad/s": 180 / math.pi}
"""Unit of a slot -> its number of degrees; other units stay as they are."""
BASE: Final = {"xSpeed": "x.vel", "ySpeed": "y.vel", "yawSpeed": "theta.vel"}
"""Slot of a base -> LeRobot's name."""
FULL: Final = 100.0
"""A gripper that is quite open."""


class LerobotChannel(NamedTuple):
    """A number of LeRobot: its name, its slot, and how it is counted, ``(value - zero) * factor``."""

    name: str
    slot: str
    zero: float = 0.0
    factor: float = 1.0

    def to_lerobot(self, value: float) -> float:
        """The number for a value of the slot."""
        return (value - self.zero) * self.factor

    def to_slot(self, number: float) -> float:
        """The value of the slot for a number.  Raises ValueError for nan and infinite ones."""
        if not math.isfinite(number):
            raise ValueError(f"{self.name}: {number} is no goal")
        return number / self.factor + self.zero


def joint_channel(robot: Robot, joint: str, prefix: str, grippers: Sequence[str]) -> LerobotChannel:
    """The channel of a joint.  Raises ClientError, ValueError for a gripper without a range."""
    path = f"{prefix}.{joint}.val" if prefix else f"{joint}.val"
    slot = robot.slot(path)
    if joint not in grippers:
        return LerobotChannel(f"{joint}.pos", path, factor=DEGREES.get(slot.unit, 1.0))
    least, most = slot.min, slot.max
    if not -math.inf < least < most < math.inf:
        raise ValueError(f"{path} has no range from 0 to 100: calibrate it, or leave it out of grippers")
    return LerobotChannel(f"{joint}.pos", path, least, FULL / (most - least))


def joint_channels(robot: Robot, joints: str, prefix: str, grippers: str) -> list[LerobotChannel]:
    """The channels of joints; ``joints`` and ``grippers`` are names behind commas; without ``joints`` there are all of
    the robot, in their order.  Raises ClientError, ValueError."""
    names = names_of(joints) or robot.joints
    return [joint_channel(robot, name, prefix, names_of(grippers)) for name in names]


def base_channels(robot: Robot) -> list[LerobotChannel]:
    """The channels of a base; none for a robot that does not drive.  Raises ClientError."""
    rows = [row for row in robot.overview()["effectors"] if row["role"] == "base"]
    found = {row["slot"].rpartition(".")[2]: row for row in rows}
    return [
        LerobotChannel(name, found[slot]["slot"], factor=DEGREES.get(found[slot].get("unit", ""), 1.0))
        for slot, name in BASE.items() if slot in found
    ]  # fmt: skip


def names_of(text: str) -> list[str]:
    """The names that stand behind commas in a text."""
    return [name.strip() for name in text.split(",") if name.strip()]
