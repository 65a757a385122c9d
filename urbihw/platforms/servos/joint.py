"""A servo as a joint: positions and directions in the frame of the joint above, raw counts of its registers below."""

from __future__ import annotations

from functools import partial

from urbihw.buses.servos import units
from urbihw.buses.servos.item import ControlTable
from urbihw.kernel.uobject import UVar
from urbihw.platforms.servos.frame import JointFrame
from urbihw.platforms.servos.slots import ChangeHandler, Facts, RegisterSlot


class JointCounts:
    """Converts positions of one joint in rad to counts of the registers of its servo, and back."""

    def __init__(self, table: ControlTable, frame: JointFrame) -> None:
        self._table, self._frame = table, frame

    def angle_of(self, item: str, raw: int) -> float:
        """Return the position of the joint in rad for a count of a position register."""
        return self._frame.joint(units.to_si(self._table.item(item), raw))

    def count_of(self, item: str, angle: float) -> int:
        """Return the count of a position register for a position of the joint in rad.  Raises BadValue."""
        return units.from_si(self._table.item(item), self._frame.servo(angle))

    def counts_of_limits(self, items: tuple[str, str], least: float, most: float) -> dict[str, int]:
        """Return the counts of the two limit registers for limits of the joint in rad.  Raises BadValue."""
        first, second = items
        low, high = sorted((self._frame.servo(least), self._frame.servo(most)))
        return {first: self._count_within(first, low), second: self._count_within(second, high)}

    def _count_within(self, item: str, angle: float) -> int:
        least, most = units.limits_si(self._table.item(item))
        return units.from_si(self._table.item(item), min(max(angle, least), most))

    def range_of(self, item: str) -> tuple[float, float]:
        """Return the lowest and highest position of the joint that a position register takes."""
        least, most = units.limits_si(self._table.item(item))
        low, high = sorted((self._frame.joint(least), self._frame.joint(most)))
        return low, high

    def change_handler(self, row: RegisterSlot, var: UVar, facts: Facts) -> ChangeHandler:
        """Return the handler that shows a changed register in the frame of the joint."""
        convert, show = units.unit_of(self._table.item(row.item)).to_si, row.view.show
        turn = partial(self._frame.shown, row.name)

        def show_value(raw: int, stamp: float) -> None:
            var.sense(turn(show(convert(raw), facts)), stamp)

        return show_value
