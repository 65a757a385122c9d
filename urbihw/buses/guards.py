"""Supervision of measured values (temperature, voltage).  No I/O: samples in, targets and messages out.

A threshold is passed when the value is beyond its level, and left when the value is back by the hysteresis.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from urbihw.buses.messages import Samples, Threshold, ThresholdCrossed


class ThresholdMonitor:
    """The thresholds of all devices.

    Attributes:
        held: device -> name of the threshold that forbids its motion.
    """

    def __init__(self) -> None:
        self.held: dict[Any, str] = {}
        self._thresholds: dict[Any, list[Threshold]] = {}
        self._passed: set[Threshold] = set()

    def set_thresholds(self, thresholds: tuple[Threshold, ...]) -> None:
        """Replace all thresholds; a passed one stays passed if the new list still has it."""
        self._thresholds = {}
        for threshold in thresholds:
            self._thresholds.setdefault(threshold.device, []).append(threshold)
        self._passed &= {*thresholds}
        self._update_held()

    def check_samples(self, samples: Samples) -> tuple[dict[tuple[Any, str], Any], list[ThresholdCrossed]]:
        """Return the targets to set for thresholds that were passed or left, and a message for each."""
        targets: dict[tuple[Any, str], Any] = {}
        news: list[ThresholdCrossed] = []
        if not self._thresholds:
            return targets, news
        for device, values in samples.values.items():
            for threshold in self._thresholds.get(device, ()):
                if threshold.item in values:
                    self._check_threshold(threshold, values, targets, news)
        if news:
            self._update_held()
        return targets, news

    def _check_threshold(
        self,
        threshold: Threshold,
        values: Mapping[str, Any],
        targets: dict[tuple[Any, str], Any],
        news: list[ThresholdCrossed],
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
        device, name, item = threshold.device, threshold.name, threshold.item
        news.append(ThresholdCrossed(device, name, item, value, not passed, threshold.holds))

    def _update_held(self) -> None:
        self.held = {threshold.device: threshold.name for threshold in self._passed if threshold.holds}
