"""A device as a joint: positions and directions in the frame of the joint, raw counts below."""

from __future__ import annotations

from functools import partial

from urbihw.buses.servos import units
from urbihw.kernel.uobject import UVar
from urbihw.platforms.servos.devices import ChangeHandler
from urbihw.platforms.servos.frame import JointFrame
from urbihw.platforms.servos.registers import RegisterDevice
from urbihw.platforms.servos.slots import RegisterSlot


class Joint(RegisterDevice):
    """A device with a frame, which is set before ``init``."""

    frame: JointFrame
    limits: tuple[str, str]
    """The registers of cwLimit and ccwLimit."""

    def raw_of(self, row: RegisterSlot, value: float) -> int:
        """Return the raw count for a value of a slot, in the frame of the joint.  Raises BadValue."""
        return super().raw_of(row, self.frame.wanted(row.name, value))

    def angle_of(self, item: str, raw: int) -> float:
        """Return the position of the joint in rad for a count of a position register."""
        return self.frame.joint(units.to_si(self.table.item(item), raw))

    def count_of(self, item: str, angle: float) -> int:
        """Return the count of a position register for a position of the joint in rad.  Raises BadValue."""
        return units.from_si(self.table.item(item), self.frame.servo(angle))

    def counts_of_limits(self, least: float, most: float) -> dict[str, int]:
        """Return the counts of the two limit registers for limits of the joint in rad.  Raises BadValue."""
        first, second = self.limits
        low, high = sorted((self.frame.servo(least), self.frame.servo(most)))
        return {first: self._count_within(first, low), second: self._count_within(second, high)}

    def _count_within(self, item: str, angle: float) -> int:
        least, most = units.limits_si(self.table.item(item))
        return units.from_si(self.table.item(item), min(max(angle, least), most))

    def range_of(self, item: str) -> tuple[float, float]:
        """Return the lowest and highest position of the joint that a position register takes."""
        least, most = units.limits_si(self.table.item(item))
        low, high = sorted((self.frame.joint(least), self.frame.joint(most)))
        return low, high

    def framed_handler(self, row: RegisterSlot, var: UVar) -> ChangeHandler:
        """Return the handler that shows a changed register in the frame of the joint."""
        if self.frame.is_plain:
            return super().change_handler(row, var)
        convert, show, facts = units.unit_of(self.table.item(row.item)).to_si, row.view.show, self.facts
        turn = partial(self.frame.shown, row.name)

        def show_value(raw: int, stamp: float) -> None:
            var.sense(turn(show(convert(raw), facts)), stamp)

        return show_value
