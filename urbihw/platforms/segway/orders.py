"""Configurations for the base: one with each command, and a check whether it took effect.

Nothing is acknowledged. The base reports its mode and gain schedule in 0x0406, so those two are checked and sent again
if they do not appear; the others are sent once, without confirmation.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

from urbihw.buses.messages import Reply
from urbihw.platforms.segway import protocol as p

TIMEOUT_S = 0.2
"""Seconds after which a configuration that the base does not report counts as failed."""
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
        """Whether the base reports this configuration; a base that is switched off reports nothing."""
        return self.name in _SHOWN and not (self.name == "mode" and self.parameter == _POWER_DOWN)


class Orders:
    """A queue of configurations, one of them in progress."""

    def __init__(self) -> None:
        self._waiting: deque[_Order] = deque()
        self._under_way: _Order | None = None
        self._due = False

    def add_order(self, reply_id: int, name: str, parameter: int) -> str:
        """Queue a configuration; return the error, or ""."""
        row = p.CONFIGURATIONS.get(name)
        if row is None:
            return f"no such setting {name!r}; there are: {', '.join(p.CONFIGURATIONS)}"
        if not 0 <= parameter <= row[1]:
            return f"{name} must be a number from 0 to {row[1]}, not {parameter}"
        self._waiting.append(_Order(reply_id, name, parameter))
        return ""

    def next_order(self, now: float) -> tuple[str, int] | None:
        """Return the configuration for this command, (name, parameter), or None."""
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

    def check_progress(self, values: Mapping[str, int], now: float) -> list[Reply]:
        """Check whether the configuration in progress took effect; return replies."""
        order = self._under_way
        if order is None or self._due:
            return []
        # The oldest firmware reports neither of them.
        if not order.shown or values.get(order.name, order.parameter) == order.parameter:
            return [self._done(Reply(order.reply_id, True, order.parameter))]
        if now - order.sent_at < TIMEOUT_S:
            return []
        if order.attempts < ATTEMPTS:
            self._due = True
            return []
        return [self._done(Reply(order.reply_id, False, error=self._refusal(order, values)))]

    def drop_all(self, reason: str) -> list[Reply]:
        """Drop all configurations; return their replies."""
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
