"""Who holds a robot by an emergency stop, as the daemon and the supervisor of its worker see it.

The worker has the last word, but its reports take a moment, and meanwhile there are further orders: a report that was
posted before the worker got the last press or release must not undo that.  So each order has a number, a report tells
the last one that it answers, and the orders behind that one are carried out again on what it tells.
"""

from __future__ import annotations

from collections import deque

from urbihw.buses import messages as m
from urbihw.buses.latches import pressed, released

LatchOrder = m.EmergencyStop | m.Release


class LatchView:
    """The latches of one robot.

    Attributes:
        holders: user -> name, of those who hold it.
    """

    def __init__(self) -> None:
        self.holders: dict[str, str] = {}
        self._pending: deque[LatchOrder] = deque()
        self._last = self._answered = 0

    def next_number(self) -> int:
        """The number of the next order."""
        return self._last + 1

    def order(self, order: LatchOrder) -> None:
        """An order goes to the worker: show what it will do."""
        self._last = order.order
        self._pending.append(order)
        self.holders = _after(self.holders, order)

    def preview(self, order: LatchOrder) -> dict[str, str]:
        """The latches after an order."""
        return _after(self.holders, order)

    def report(self, message: m.Latched) -> frozenset[str]:
        """The worker reports; return the users who have pressed beside the orders of this daemon."""
        is_answer, self._answered = message.order > self._answered, max(self._answered, message.order)
        while self._pending and self._pending[0].order <= message.order:
            self._pending.popleft()
        before, self.holders = self.holders, dict(message.holders)
        for order in self._pending:
            self.holders = _after(self.holders, order)
        pressed_now = frozenset(user for user, name in self.holders.items() if before.get(user) != name)
        if message.who and not message.freed and not is_answer and not pressed_now:
            return frozenset(self.holders)  # one of them once more, by the same name
        return pressed_now


def _after(holders: dict[str, str], order: LatchOrder) -> dict[str, str]:
    if isinstance(order, m.EmergencyStop):
        return pressed(holders, order.who, order.user)
    return released(holders, order.user, order.others, order.everyone)
