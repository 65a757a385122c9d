"""The orders to the joints: targets that wait for the next cycle, and what was sent; no I/O."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from urbihw.frozen import frozen

REACHED: Final = 0.02
"""Rad from its goal at which a joint is there."""
SLACK: Final = 0.02
"""Stiffness below which a motor does not hold."""
SHARED_MOTORS: Final[Mapping[str, str]] = {"RHipYawPitch": "LHipYawPitch"}
"""Joints that have the motor of another one (fact sheet, section 6)."""


@frozen
class JointInfo:
    """A joint as NAOqi describes it: rad and rad/s; a hand from 0, closed, to 1."""

    name: str
    low: float
    high: float
    speed: float


class JointOrders:
    """Goals and stiffnesses of all joints.

    Attributes:
        angles: goals that were not sent yet; stiffnesses: the same.
        sent: the goals that were sent since the joint was last told to hold.
        where, stiff: the last measurements.
    """

    def __init__(self) -> None:
        self.angles: dict[str, float] = {}
        self.stiffnesses: dict[str, float] = {}
        self.sent: dict[str, float] = {}
        self.where: dict[str, float] = {}
        self.stiff: dict[str, float] = {}

    def drop_waiting(self, joints: Iterable[str]) -> None:
        """Drop the targets that wait for the next cycle."""
        for name in joints:
            self.angles.pop(name, None)
            self.stiffnesses.pop(name, None)

    def pop_angles(self) -> dict[str, float]:
        """The goals to send now."""
        angles, self.angles = self.angles, {}
        self.sent |= angles
        return angles

    def pop_stiffnesses(self) -> tuple[dict[str, float], dict[str, float]]:
        """The stiffnesses to send now, and the goals to send before them: a joint that gets stiff stays where it is.

        NAOqi may still have an old goal for it.
        """
        stiffnesses, self.stiffnesses = self.stiffnesses, {}
        fresh = [name for name, value in stiffnesses.items() if value > SLACK > self.stiff.get(name, 0.0)]
        goals = {name: self.where[name] for name in fresh if name in self.where}
        # An angle that was asked for in the same cycle goes behind them.
        self.sent |= goals
        self.stiff |= stiffnesses
        return stiffnesses, goals

    def under_way(self, joints: Iterable[str], where: Mapping[str, float]) -> dict[str, float]:
        """The joints among these that have not reached their goal yet, and where they are."""
        return {
            name: where[name]
            for name in joints
            if name in self.sent and name in where and abs(self.sent[name] - where[name]) > REACHED
        }

    def hold(self, where: Mapping[str, float]) -> None:
        """Let these joints stay."""
        self.sent |= where
