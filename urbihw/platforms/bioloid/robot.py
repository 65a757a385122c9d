"""The object ``bioloid``: the bus as urbiscript sees it, with its devices as they are found."""

from __future__ import annotations

from typing import Final

from urbihw.buses.servos.device import DeviceInfo
from urbihw.platforms.bioloid.sensors import AXS1
from urbihw.platforms.servos.anglelimits import AngleLimitServo
from urbihw.platforms.servos.devices import ServoBusDevice
from urbihw.platforms.servos.modeservo import ModeServo
from urbihw.platforms.servos.robot import Devices, ServoRobot


class AX12(AngleLimitServo):
    """An AX-12, AX-12W or AX-18."""


class XServo(ModeServo):
    """A servo of the X series by ROBOTIS."""


CLASSES: Final[dict[str, type[ServoBusDevice]]] = {
    "AX-12": AX12,
    "AX-S1": AXS1,
    "XL330": XServo,
    "XC330-T": XServo,
    "XL430": XServo,
    "XM430": XServo,
}
"""Control table (``DeviceInfo.family``) -> class."""


class Bioloid(ServoRobot):
    """A Bioloid on one bus."""

    classes = (AX12, XServo, AXS1, Devices)

    robot_name = "bioloid"
    model_name = "ROBOTIS Bioloid"
    kinds = ("motor", "sensor")

    def class_of(self, info: DeviceInfo) -> type[ServoBusDevice] | None:
        """Return the class of its control table."""
        return CLASSES.get(info.family)
