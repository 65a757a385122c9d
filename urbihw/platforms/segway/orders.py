"""Configurations on their way to the base: one with each command, each once, and a look whether it was obeyed.

Nothing is acknowledged. The mode and the gain schedule come back in 0x0406, so those two are looked for and sent again
if they do not show; of the others it is only known that they were sent.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

from urbihw.buses.messages import Reply
from urbihw.platforms.segway import protocol as p

PATIENCE = 0.2
"""Seconds until an order that shows is looked upon as not taken."""
ATTEMPTS = 3
_SHOWN = {"mode", "gain"}
_POWER_DOWN = 3


@dataclass
class _Order:
    reply_id: int
    name: str
    parameter: int
    attempts: int = 0
    sent_at: float = 0.0

    @property
    def shown(self) -> bool:
        """Whether the base tells that it obeyed; a base that was switched off says nothing more."""
        return self.name in _SHOWN and not (self.name == "mode" and self.parameter == _POWER_DOWN)


class Orders:
    """A queue, with one order under way."""

    def __init__(self) -> None:
        self._waiting: deque[_Order] = deque()
        self._under_way: _Order | None = None
        self._due = False

    def add(self, reply_id: int, name: str, parameter: int) -> str:
        """Queue an order; why it cannot be, or ""."""
        row = p.CONFIGURATIONS.get(name)
        if row is None:
            return f"no such setting {name!r}; there are: {', '.join(p.CONFIGURATIONS)}"
        if not 0 <= parameter <= row[1]:
            return f"{name} must be a number from 0 to {row[1]}, not {parameter}"
        self._waiting.append(_Order(reply_id, name, parameter))
        return ""

    def next(self, now: float) -> tuple[str, int] | None:
        """The order that goes with this command, (name, parameter), or None."""
        if self._under_way is None and self._waiting:
            self._under_way = self._waiting.popleft()
            self._due = True
        order = self._under_way
        if order is None or not self._due:
            return None
        self._due = False
        order.attempts += 1
        order.sent_at = now
        return order.name, order.parameter

    def check(self, values: Mapping[str, int], now: float) -> list[Reply]:
        """Look whether the order under way was obeyed."""
        order = self._under_way
        if order is None or self._due:
            return []
        # The oldest firmware shows nothing.
        if not order.shown or values.get(order.name, order.parameter) == order.parameter:
            return [self._done(Reply(order.reply_id, True, order.parameter))]
        if now - order.sent_at < PATIENCE:
            return []
        if order.attempts < ATTEMPTS:
            self._due = True
            return []
        return [self._done(Reply(order.reply_id, False, error=self._refusal(order, values)))]

    def drop(self, reason: str) -> list[Reply]:
        """Give up all orders."""
        orders = [*([self._under_way] if self._under_way else []), *self._waiting]
        self._waiting.clear()
        self._under_way = None
        return [Reply(order.reply_id, False, error=reason) for order in orders]

    def _done(self, reply: Reply) -> Reply:
        self._under_way = None
        return reply

    @staticmethod
    def _refusal(order: _Order, values: Mapping[str, int]) -> str:
        names = p.MODES if order.name == "mode" else p.GAINS
        now = values[order.name]
        shown = names[now] if now < len(names) else str(now)
        wrong = p.fault_words(values.get("status1", 0), values.get("status2", 0))
        return f"the base stays in {order.name} {shown}" + (f" ({wrong})" if wrong else "")
