"""Measurements: one ``getListData`` of ALMemory a cycle, of joints each time, of sensors in each fifth cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

from urbihw.buses.errors import LinkGone
from urbihw.buses.messages import FromWorker, Reply, Request
from urbihw_nao import reading
from urbihw_nao.exchange import NaoExchange
from urbihw_nao.finding import NaoFinding
from urbihw_nao.orders import JointOrders
from urbihw_nao.part import NaoPart
from urbihw_nao.qimessaging.checked import to_row
from urbihw_nao.qimessaging.session import QiCall

SLOW_CYCLES: Final = 5
"""Sensors and temperatures are read in each such cycle."""


MEMORY_VALUES: Final = "memory"
"""The device whose items are the keys of ALMemory that programs follow."""
MOST_FOLLOWED: Final = 64


class SensePart(NaoPart):
    """Values "angle", "stiffness", "temperature" of joints, and those of ``reading.SENSORS``.

    Request "follow" of a key of ALMemory: it is read in each cycle from now on, also on later sessions, and told as a
    value of MEMORY_VALUES when it has changed.  The answer is a list with its value, an empty one if it has none yet.
    """

    verbs = frozenset({"follow"})

    def __init__(self, exchange: NaoExchange, orders: JointOrders) -> None:
        super().__init__(exchange)
        self._orders = orders
        self._fast: Mapping[str, reading.Key] = {}
        self._all: Mapping[str, reading.Key] = {}
        self._cycle = 0
        self._followed: list[str] = []
        self._told: dict[str, Any] = {}

    def begin(self) -> None:
        """See ``Part``: NAOqi may have been restarted, so it gets all that is followed again."""
        self._told.clear()

    def request(self, message: Request) -> list[FromWorker]:
        key = str(message.device)
        if key not in self._followed:
            if len(self._followed) == MOST_FOLLOWED:
                raise ValueError(f"{MOST_FOLLOWED} keys of ALMemory are followed: no more")
            self._followed.append(key)
        value = to_row(self.exchange.ask(self.exchange.memory, "getListData", [key]), 1)[0]
        if value is not None and not reading.is_bounded(value):
            self._followed.remove(key)
            raise ValueError(f"the value of {key} is too long, or no value for programs")
        self._told[key] = value
        return [Reply(message.reply_id, True, [] if value is None else [value])]

    def show_first(self, found: NaoFinding) -> None:
        """Take over what was found at the login, with its first values."""
        self._fast, self._all = found.fast_keys, found.all_keys
        self._show(self._all, found.values)

    def read(self) -> None:
        exchange = self.exchange
        if exchange.busy("reading"):
            return
        problem = exchange.last_error("reading")
        if problem:
            raise LinkGone(f"NAOqi does not tell what it measures: {problem}")
        keys = self._fast if self._cycle % SLOW_CYCLES else self._all
        self._cycle += 1
        followed = tuple(self._followed)
        then = partial(self._show_answer, keys, followed)
        exchange.call("reading", exchange.memory, "getListData", [*keys, *followed], then=then)

    def _show_answer(self, keys: Mapping[str, reading.Key], followed: Sequence[str], call: QiCall) -> None:
        values = call.value
        if followed and isinstance(values, list):
            self._show_followed(followed, values[len(keys) :])
            values = values[: len(keys)]
        self._show(keys, values)

    def _show_followed(self, followed: Sequence[str], values: Sequence[Any]) -> None:
        for key, value in zip(followed, values, strict=False):
            if value is not None and value != self._told.get(key) and reading.is_bounded(value):
                self._told[key] = value
                self.exchange.values.setdefault(MEMORY_VALUES, {})[key] = value

    def _show(self, keys: Mapping[str, reading.Key], values: Any) -> None:
        ranges = {joint.name: joint for joint in self.exchange.info.joints}
        for device, items in reading.sort_values(keys, values).items():
            joint, angle = ranges.get(device), items.get("angle")
            if joint is not None and angle is not None:
                if not joint.low - reading.OUTSIDE <= angle <= joint.high + reading.OUTSIDE:
                    continue
                self._orders.where[device] = angle
                self._orders.stiff[device] = items.get("stiffness", 0.0)
            self.exchange.values.setdefault(device, {}).update(items)
