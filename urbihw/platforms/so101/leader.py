"""The leader arm: a second arm on a bus of its own, moved by hand, whose joints are only read.

It is a robot bus of its own, with its own worker: a leader that is unplugged or slow does not delay the follower.
"""

from __future__ import annotations

from typing import Final

from urbihw.buses.servos.device import DeviceInfo
from urbihw.buses.servos.status import FEETECH
from urbihw.kernel.uobject import Opened, RobotSettings
from urbihw.platforms.servos.devices import ServoBusDevice
from urbihw.platforms.servos.robot import ServoRobot
from urbihw.platforms.so101.arm import ArmServo

HAND: Final = "the leader is moved by hand; leader.estop = false lets programs move it"
"""Who holds the emergency stop of the leader."""


class LeaderServo(ArmServo):
    """A servo of the leader: without torque, so that a hand can move it."""

    kind_of_device = "leaderMotor"


class Leader(ServoRobot):
    """The arm that is moved by hand."""

    robot_name = "leader"
    model_name = "SO-101 leader"
    whose_log = "leader"
    kinds = ("leaderMotor",)

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Start its worker, with the emergency stop on: no program moves an arm that a hand holds.

        The worker does not hear of it: it would stop an arm that does not move, and report it.
        """
        super().open(settings, opened)
        self.motion.latched = HAND
        self.guard.estop.sense(True)

    def class_of(self, info: DeviceInfo) -> type[ServoBusDevice] | None:
        """Return the class of a joint."""
        is_arm = info.protocol == FEETECH and "operating_mode" in ServoBusDevice.table_for(info).items
        return LeaderServo if is_arm else None
