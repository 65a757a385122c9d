"""Which class a device of a servo bus gets, from its control table alone."""

from __future__ import annotations

from urbihw.buses.servos.item import ControlTable
from urbihw.platforms.servos.anglelimits import AngleLimitServo
from urbihw.platforms.servos.devices import ServoBusDevice
from urbihw.platforms.servos.modeservo import ModeServo
from urbihw.platforms.servos.otherdevice import OtherDevice


def class_for(table: ControlTable) -> type[ServoBusDevice]:
    """Return the class for a control table: how the mode is selected tells the servos apart."""
    if not table.has_motor:
        return OtherDevice
    by_limits = "cw_angle_limit" in table.items and not any(item.endswith("_mode") for item in table.mode_items)
    return AngleLimitServo if by_limits else ModeServo
