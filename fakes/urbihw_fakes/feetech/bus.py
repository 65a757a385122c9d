"""The bus of Feetech servos: that of Dynamixel protocol 1.0, and SYNC READ, which only the STS series answers.

A servo that waits for a silent predecessor in a sync read stays silent too while `wait_for_predecessor` is set: the
vendor does not say, and a driver must cope with it.
"""

from __future__ import annotations

from urbihw_fakes.dynamixel.bus import Item, Reply, ServoBus
from urbihw_fakes.dynamixel.framer import Request
from urbihw_fakes.feetech.servo import FeetechServo

SYNC_READ = 0x82


class FeetechBus(ServoBus):
    """Feetech servos, and units of Dynamixel protocol 1.0 beside them, on one wire."""

    def _broadcast1(self, request: Request, now: float) -> list[Reply]:
        if request.code != SYNC_READ:
            return super()._broadcast1(request, now)
        replies: list[Reply] = []
        for unit in request.params[2:]:
            reply = self._sync_place(Item(unit, request.params[0], request.params[1]), now)
            if not reply.data and self.wait_for_predecessor:
                break
            replies.append(reply)
        return replies

    def _sync_place(self, item: Item, now: float) -> Reply:
        """Return one place in a sync read."""
        units = [u for u in self._listening(1, item.unit) if isinstance(u, FeetechServo) and u.answers_sync_read]
        return self._reply(item.unit, [(unit, unit.report(item.address, item.count, now)) for unit in units])

    def servo(self, number: int) -> FeetechServo:
        """Return the Feetech servo with this ID.

        Raises:
            NoSuchUnit: nothing has it.
            TypeError: it is something else.
        """
        unit = self[number]
        if not isinstance(unit, FeetechServo):
            raise TypeError(f"unit {number}: this is {type(unit).__name__}, not a Feetech servo")
        return unit
