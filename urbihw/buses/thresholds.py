"""Supervision of measured values (temperature, voltage).  No I/O: samples in, targets and messages out.

A threshold is passed when the value is beyond its level, and left when the value is back by the hysteresis. What it
reduces meanwhile gets the value that it had before, and not more than that: a program may have set a torque limit to 0.
What was lower already, or has been changed since, stays as it is.
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
        self._values: dict[Any, dict[str, Any]] = {}
        self._before: dict[tuple[Threshold, str], Any] = {}

    def set_thresholds(
        self, thresholds: tuple[Threshold, ...]
    ) -> tuple[dict[tuple[Any, str], Any], list[ThresholdCrossed]]:
        """Replace all thresholds and judge the last values by the new ones; returns as `check_samples`.

        A passed one that the new list does not have, by its name, is left. One that it has, with whatever level, stays
        passed until the value is back from the new level by the hysteresis.
        """
        before = {_identity_of(threshold): threshold for threshold in self._passed}
        now = {_identity_of(threshold): threshold for threshold in thresholds}
        self._thresholds = {}
        for threshold in thresholds:
            self._thresholds.setdefault(threshold.device, []).append(threshold)
        self._passed = {now[each] for each in before if each in now}
        self._before = {
            (now.get(_identity_of(last), last), item): raw for (last, item), raw in self._before.items()
        }
        targets: dict[tuple[Any, str], Any] = {}
        news: list[ThresholdCrossed] = []
        for identity, last in before.items():
            present = now.get(identity)
            if present is None:
                value = self._values[last.device][last.item]
                targets.update(self._give_back(last))
                news.append(ThresholdCrossed(last.device, last.name, last.item, value, False, last.holds))
            elif present.targets != last.targets:
                # Its device has changed its mode.
                targets.update(self._take_away(present))
        self._check_values(self._values, targets, news)
        self._update_held()
        return targets, news

    def check_samples(self, samples: Samples) -> tuple[dict[tuple[Any, str], Any], list[ThresholdCrossed]]:
        """Return the targets to set for thresholds that were passed or left, and a message for each."""
        targets: dict[tuple[Any, str], Any] = {}
        news: list[ThresholdCrossed] = []
        for device, values in samples.values.items():
            self._values.setdefault(device, {}).update(values)
        if self._thresholds:
            self._check_values(samples.values, targets, news)
        if news:
            self._update_held()
        return targets, news

    def _check_values(
        self,
        sampled: Mapping[Any, Mapping[str, Any]],
        targets: dict[tuple[Any, str], Any],
        news: list[ThresholdCrossed],
    ) -> None:
        for device, values in sampled.items():
            for threshold in self._thresholds.get(device, ()):
                if threshold.item in values:
                    self._check_threshold(threshold, values, targets, news)

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
            targets.update(self._take_away(threshold))
        elif passed and beyond < -threshold.hysteresis:
            self._passed.discard(threshold)
            targets.update(self._give_back(threshold))
        else:
            return
        device, name, item = threshold.device, threshold.name, threshold.item
        news.append(ThresholdCrossed(device, name, item, value, not passed, threshold.holds))

    def note_written(self, device: Any, item: str, raw: Any) -> None:
        """Take a value that a program writes; readings may be a second old."""
        if device in self._thresholds:
            self._values.setdefault(device, {})[item] = raw

    def _take_away(self, threshold: Threshold) -> dict[tuple[Any, str], Any]:
        """Return the targets of a threshold that was passed; what is lower already stays."""
        targets: dict[tuple[Any, str], Any] = {}
        full = dict(threshold.restored)
        values = self._values.setdefault(threshold.device, {})
        for item, raw in threshold.targets:
            if item in full:
                before = values.get(item, full[item])
                if before <= raw:
                    continue
                self._before[threshold, item] = min(before, full[item])
            targets[threshold.device, item] = values[item] = raw
        return targets

    def _give_back(self, threshold: Threshold) -> dict[tuple[Any, str], Any]:
        """Return the targets of a threshold that was left; values that were changed since it was passed stay."""
        targets: dict[tuple[Any, str], Any] = {}
        taken = dict(threshold.targets)
        values = self._values[threshold.device]
        for item, raw in threshold.restored:
            if item not in taken:
                targets[threshold.device, item] = raw
            elif (threshold, item) in self._before:
                before = self._before.pop((threshold, item))
                if values[item] == taken[item]:
                    targets[threshold.device, item] = values[item] = before
        return targets

    def _update_held(self) -> None:
        self.held = {
            each.device: f"{each.name}: {each.advice}" if each.advice else each.name
            for each in self._passed
            if each.holds
        }


def _identity_of(threshold: Threshold) -> tuple[Any, str, str, bool]:
    """What makes it the same threshold with another level: the lowest and the highest voltage have one name."""
    return threshold.device, threshold.item, threshold.name, threshold.above
