"""Measurements: one ``getListData`` of ALMemory a cycle, of joints each time, of sensors in each fifth cycle."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from urbihw.buses.errors import LinkGone
from urbihw.buses.qi.session import Call
from urbihw.platforms.nao import reading
from urbihw.platforms.nao.exchange import Exchange
from urbihw.platforms.nao.finding import Finding
from urbihw.platforms.nao.orders import JointOrders
from urbihw.platforms.nao.part import Part

SLOW_CYCLES: Final = 5
"""Sensors and temperatures are read in each such cycle."""


class SensePart(Part):
    """Values "angle", "stiffness", "temperature" of joints, and those of ``reading.SENSORS``."""

    def __init__(self, exchange: Exchange, orders: JointOrders) -> None:
        super().__init__(exchange)
        self._orders = orders
        self._fast: Mapping[str, reading.Key] = {}
        self._all: Mapping[str, reading.Key] = {}
        self._cycle = 0

    def show_first(self, found: Finding) -> None:
        """Take over what was found at the login, with its first values."""
        self._fast, self._all = found.fast_keys, found.all_keys
        self._show(self._all, found.values)

    def read(self) -> None:
        """See ``Part``."""
        exchange = self.exchange
        if exchange.busy("reading"):
            return
        problem = exchange.last_error("reading")
        if problem:
            raise LinkGone(f"NAOqi does not tell what it measures: {problem}")
        keys = self._fast if self._cycle % SLOW_CYCLES else self._all
        self._cycle += 1
        exchange.call("reading", exchange.memory, "getListData", list(keys), then=partial(self._show_answer, keys))

    def _show_answer(self, keys: Mapping[str, reading.Key], call: Call) -> None:
        self._show(keys, call.value)

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
