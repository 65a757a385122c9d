"""The frame of a joint: how its position and direction follow from those of the servo, both in SI units."""

from __future__ import annotations

import math
from typing import Final

from urbihw.buses.servos.calibration import JointCalibration
from urbihw.buses.servos.item import Item
from urbihw.buses.servos.units import unit_of
from urbihw.frozen import frozen
from urbihw.platforms.expected import DeviceSettings

_TURNED: Final = frozenset({"speed", "torque", "current", "goalCurrent", "goalPwm"})
_PLACES: Final = frozenset({"val"})


@frozen(slots=False)
class JointFrame:
    """The joint's position is ``direction`` * position of the servo + ``shift``; speeds and torques are turned only.

    Attributes:
        direction: 1 or -1.
        shift: rad.
        low, high: the range of the joint in rad; infinite for none.
        limit: the name of the setting that the range comes from.
        name: of the joint, "" for none.
        groups: the groups that it belongs to.
    """

    direction: int = 1
    shift: float = 0.0
    low: float = -math.inf
    high: float = math.inf
    limit: str = ""
    name: str = ""
    groups: tuple[str, ...] = ()

    @property
    def is_plain(self) -> bool:
        """Whether positions and directions are those of the servo."""
        return self.direction == 1 and self.shift == 0

    def joint(self, angle: float) -> float:
        """Return the position of the joint in rad for one of the servo."""
        return self.direction * angle + self.shift

    def servo(self, angle: float) -> float:
        """Return the position of the servo in rad for one of the joint."""
        return (angle - self.shift) * self.direction

    def shown(self, slot: str, value: float) -> float:
        """Return the value of a slot for the value of the servo."""
        return self.joint(value) if slot in _PLACES else value * self.direction if slot in _TURNED else value

    def wanted(self, slot: str, value: float) -> float:
        """Return the value of the servo for a value written to a slot."""
        return self.servo(value) if slot in _PLACES else value * self.direction if slot in _TURNED else value


def frame_of(
    place: Item, settings: tuple[str, DeviceSettings] | None, calibration: tuple[str, JointCalibration] | None
) -> JointFrame:
    """Return the frame of a servo.

    ``place`` is its register of the present position, ``settings`` its name and row of ``[devices]``, ``calibration``
    its name and row of the calibration file.  With a calibration, position 0 is the middle of the recorded range, and
    the range limits the joint.  Offset and direction of ``[devices]`` count from there on; limits of ``[devices]`` come
    instead of the range.
    """
    unit = unit_of(place)
    zero, step = unit.to_si(0), unit.to_si(1) - unit.to_si(0)
    direction, shift, low, high, limit, name = 1, 0.0, -math.inf, math.inf, "", ""
    groups: tuple[str, ...] = ()
    if calibration is not None:
        name, row = calibration
        direction = -1 if row.drive_mode else 1
        shift = -direction * (zero + step * row.middle)
        high = (row.range_max - row.range_min) / 2 * step
        low, limit = -high, f"the calibrated range of {name or f'motor{row.id}'}"
    if settings is not None:
        name, own = settings
        direction, shift = direction * own.direction, shift * own.direction + own.offset
        low, high, groups = low + own.offset, high + own.offset, own.groups
        if own.limits != (-math.inf, math.inf):
            (low, high), limit = own.limits, f"devices.{name}.limits"
    return JointFrame(direction, shift, low, high, limit, name, groups)
