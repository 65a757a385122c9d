"""The object ``chain``: the bus as urbiscript sees it, with its devices as they are found."""

from __future__ import annotations

from urbihw.buses.servos.device import DeviceInfo
from urbihw.platforms.servos.anglelimits import AngleLimitServo
from urbihw.platforms.servos.devices import ServoBusDevice
from urbihw.platforms.servos.kinds import class_for
from urbihw.platforms.servos.modeservo import ModeServo
from urbihw.platforms.servos.otherdevice import OtherDevice
from urbihw.platforms.servos.robot import Devices, ServoRobot


class Chain(ServoRobot):
    """Servos, and other devices, on one bus."""

    classes = (AngleLimitServo, ModeServo, OtherDevice, Devices)

    robot_name = "chain"
    model_name = "servo chain"
    kinds = ("motor", "device")

    def class_of(self, info: DeviceInfo) -> type[ServoBusDevice] | None:
        """Return the class for its control table."""
        return class_for(ServoBusDevice.table_for(info))
