"""What a worker does about measured values that go too far: heat, voltage.  No I/O: samples in, targets and news out.

A threshold is passed when a value is beyond its level, and left again when the value is back by the hysteresis.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from urbihw.buses.messages import Guarded, Samples, Threshold


class Guards:
    """The thresholds of all devices.

    Attributes:
        held: device -> name of the threshold that lets nothing move it.
    """

    def __init__(self) -> None:
        self.held: dict[Any, str] = {}
        self._thresholds: dict[Any, list[Threshold]] = {}
        self._passed: set[Threshold] = set()

    def set(self, thresholds: tuple[Threshold, ...]) -> None:
        """Take new thresholds; those that are passed stay so if they are still among them."""
        self._thresholds = {}
        for threshold in thresholds:
            self._thresholds.setdefault(threshold.device, []).append(threshold)
        self._passed &= {*thresholds}
        self._find_held()

    def look(self, samples: Samples) -> tuple[dict[tuple[Any, str], Any], list[Guarded]]:
        """Take samples in: the targets to set for what was passed or left, and the news of it."""
        targets: dict[tuple[Any, str], Any] = {}
        news: list[Guarded] = []
        if not self._thresholds:
            return targets, news
        for device, values in samples.values.items():
            for threshold in self._thresholds.get(device, ()):
                if threshold.item in values:
                    self._compare(threshold, values, targets, news)
        if news:
            self._find_held()
        return targets, news

    def _compare(
        self,
        threshold: Threshold,
        values: Mapping[str, Any],
        targets: dict[tuple[Any, str], Any],
        news: list[Guarded],
    ) -> None:
        value = values[threshold.item]
        beyond = value - threshold.level if threshold.above else threshold.level - value
        passed = threshold in self._passed
        if not passed and beyond >= 0:
            self._passed.add(threshold)
            wanted = threshold.targets
        elif passed and beyond < -threshold.hysteresis:
            self._passed.discard(threshold)
            wanted = threshold.restored
        else:
            return
        targets.update({(threshold.device, item): raw for item, raw in wanted})
        news.append(Guarded(threshold.device, threshold.name, threshold.item, value, not passed, threshold.holds))

    def _find_held(self) -> None:
        self.held = {threshold.device: threshold.name for threshold in self._passed if threshold.holds}
