"""The object ``so101``: the follower arm as urbiscript sees it, and the leader arm if the settings name one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from urbihw.buses.servos.device import DeviceInfo
from urbihw.buses.servos.status import FEETECH
from urbihw.kernel.uobject import BadConfig, DeviceError, Opened, RobotSettings
from urbihw.platforms.servos.devices import ServoBusDevice
from urbihw.platforms.servos.options import CALIBRATION
from urbihw.platforms.servos.robot import Devices, ServoRobot
from urbihw.platforms.so101.arm import GRIPPER, JOINTS, ArmServo, GripperServo
from urbihw.platforms.so101.leader import Leader, LeaderServo
from urbihw.platforms.so101.options import LEADER, LEADER_CALIBRATION


class SO101(ServoRobot):
    """An arm that is driven: the follower of a teleoperation."""

    classes = (ArmServo, GripperServo, Leader, LeaderServo, Devices)

    robot_name = "so101"
    model_name = "SO-101"

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self._leader: Leader | None = None

    def class_of(self, info: DeviceInfo) -> type[ServoBusDevice] | None:
        """Return the class of the gripper, whatever the settings call it, or of a joint; an arm has STS servos only."""
        if info.protocol != FEETECH or "operating_mode" not in ServoBusDevice.table_for(info).items:
            return None
        return GripperServo if info.id == self._gripper_id() else ArmServo

    def _gripper_id(self) -> int:
        """Return the id of the joint ``gripper``; where no joint has this name, that of LeRobot's set-up."""
        ids = {name: number for number, (name, _) in (*self._calibrated.items(), *self._named.items())}
        return ids.get(GRIPPER, JOINTS[GRIPPER])

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Start the worker of the arm, and that of the leader."""
        options = dict(settings.options)
        leader = options.pop(LEADER, "")
        calibration = options.pop(LEADER_CALIBRATION, "")
        super().open(replace(settings, options=options, devices=joints_of(settings.devices)), opened)
        if leader:
            if leader == settings.url:
                raise BadConfig(f"options.{LEADER}: {leader} is the bus of the follower; the leader has its own")
            self._leader = self.host.create(Leader, "leader")
            self._leader.start_worker, self._leader.bus_time = self.start_worker, self.bus_time
            self._leader.open(leader_settings(settings, leader, calibration), self._leader_opened)

    def _leader_opened(self, error: DeviceError | None) -> None:
        """Tell why there is no leader; the follower does without."""
        if error is not None:
            self.log.warning("leader: %s", error)

    def configure(self, settings: RobotSettings) -> None:
        """Apply new settings to both arms.  Raises BadConfig."""
        options = {name: value for name, value in settings.options.items() if name not in (LEADER, LEADER_CALIBRATION)}
        super().configure(replace(settings, options=options, devices=joints_of(settings.devices)))

    def close(self) -> None:
        """Stop the arm and end the workers."""
        leader, self._leader = self._leader, None
        if leader is not None:
            leader.close()
        super().close()

    def abandon(self) -> None:
        """Stop the arm and end the workers, without touching the kernel."""
        if self._leader is not None:
            self._leader.abandon()
        super().abandon()


def joints_of(devices: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the devices of the settings, or without any the joints by LeRobot's names and ids."""
    return devices or JOINTS


def leader_settings(settings: RobotSettings, url: str, calibration: str) -> RobotSettings:
    """Return the settings of the leader arm: only its bus, its rate and its calibration; it never moves by itself."""
    options = {CALIBRATION: calibration} if calibration else {}
    return RobotSettings(url, settings.rate, settings.dead_man, options=options, devices=JOINTS)
