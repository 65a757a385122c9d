"""What every target and every request passes on its way to the driver of a wire; no I/O.

First the authority (is it of this epoch, does an emergency stop hold?), then the thresholds (is the device too hot to
move?) and the origin (has a client asked for it?), then the limits and the set points.  What asks for no motion passes
the first three in any case.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from urbihw.buses.authority import STALE, MotionAuthority
from urbihw.buses.driver import Driver
from urbihw.buses.messages import (
    FromWorker,
    Held,
    Limit,
    Limits,
    Refused,
    Reply,
    Request,
    Samples,
    Targets,
    ThresholdCrossed,
)
from urbihw.buses.setpoints import Key, SetPoints
from urbihw.buses.thresholds import ThresholdMonitor
from urbihw.frozen import frozen

NO_ORIGIN: Final = "it would move the robot, and its platform does not tell who asks for it (no origin)"
"""Why a setting that would move the robot is refused: no stop and no lease would end such a motion."""


@frozen
class ThresholdActions:
    """The consequences of thresholds that were crossed: devices to stop, targets to set, messages to post."""

    stopped: tuple[Any, ...]
    targets: Mapping[Key, Any]
    news: list[FromWorker]


class Gate:
    """The gate of one wire.  Lists that are returned are messages to post.

    Attributes:
        authority: the epoch and the latch.
        set_points: limits and catch-up movements of the targets.
    """

    def __init__(self, driver: Driver, authority: MotionAuthority) -> None:
        self.authority = authority
        self.set_points = SetPoints(driver)
        self._driver = driver
        self._thresholds = ThresholdMonitor()

    def set_limits(self, message: Limits, now: float) -> ThresholdActions:
        """Replace all limits and thresholds; live targets and the last measured values are judged by the new ones."""
        self._driver.limits_changed(message.table)
        reined = self.set_points.set_limits(message.table, now)
        targets, news = self._thresholds.set_thresholds(message.thresholds)
        # A value that an earlier threshold had changed is restored within the present limits.
        within = {key: self._within_limit(key, raw, message.table.get(key)) for key, raw in targets.items()}
        told: list[FromWorker] = [*self.set_points.pop_limited(), *news, Held(self._thresholds.held)]
        return self._threshold_actions(reined | within, told)

    def _within_limit(self, key: Key, raw: Any, limit: Limit | None) -> Any:
        if limit is None:
            return raw
        return self._driver.raw_of(*key, min(max(self._driver.signed(*key, raw), limit.low), limit.high))

    def filter_targets(self, message: Targets, now: float) -> tuple[dict[Key, Any], list[FromWorker]]:
        """Return the targets that the driver gets at once, after the limits, and the messages to post."""
        news: list[FromWorker] = []
        refusal = self.authority.refusal(message.epoch)
        passed: dict[Key, Any] = {}
        limits = self.set_points.limits
        for key, value in message.values.items():
            reason = refusal or self._holding_threshold(key[0]) or (NO_ORIGIN if key in message.settings else "")
            unheld = limits and self._driver.unheld_target(*key, value, limits)
            if unheld and not reason:
                news.append(Refused(*key, unheld))
            elif reason and self._driver.moves(*key, value):
                # A target that a stop has overtaken is dropped without a message: this is the normal case.
                news += [] if reason is STALE else [Refused(*key, reason)]
            else:
                if self._driver.regains_force(*key, value):
                    self.set_points.drop_courses((key[0],))
                self._thresholds.note_written(*key, value)
                passed[key] = value
        given = self.set_points.accept_targets(passed, now, message.time, message.resumed, message.rates)
        return given, news + [*self.set_points.pop_limited()]

    def filter_request(self, message: Request, now: float) -> tuple[Request | None, list[FromWorker]]:
        """Return the request after the limits; None and a reply if it must not be executed now.

        A write that a limit lets change only slowly becomes a target, which is reached in steps.
        """
        reason = self.authority.refusal(message.epoch) or self._holding_threshold(message.device)
        reason = reason or (NO_ORIGIN if message.setting else "")
        if reason and self._driver.request_moves(message):
            return None, [Reply(message.reply_id, False, error=reason)]
        for implied in self._driver.implied_targets(message):
            limit = self.set_points.find_exceeded_limit(implied)
            if limit:
                known = implied.value == implied.value  # nan is not
                why = f"it is beyond {limit}" if known else f"it may exceed {limit}, which cannot be told before"
                return None, [Reply(message.reply_id, False, error=why)]
        self.set_points.drop_courses(self._driver.displaced(message))
        clamp = self.set_points.clamp_value
        if message.verb == "write":
            start = self.set_points.start_ramp
            unheld = self.explain_unheld(message)
            asked = None if unheld else start(message.device, message.item, message.value, now)
            if asked is not None:
                return None, [*self.set_points.pop_limited(), Reply(message.reply_id, True, asked)]
            message = replace(message, value=clamp(message.device, message.item, message.value))
            self._thresholds.note_written(message.device, message.item, message.value)
        elif message.verb == "write_all":
            rests = self._driver.rests
            steps = tuple(
                (item, value if rests(message, at) else clamp(message.device, item, value))
                for at, (item, value) in enumerate(message.value)
            )
            message = replace(message, value=steps)
            for item, value in steps:
                self._thresholds.note_written(message.device, item, value)
        return message, [*self.set_points.pop_limited()]

    def explain_unheld(self, request: Request) -> str:
        """Return why a request that is about to be executed cannot be held within the limits, "" if it can.

        Not earlier: requests before it may have changed the mode.
        """
        limits = self.set_points.limits
        return self._driver.unheld_request(request, limits) if limits else ""

    def check_samples(self, samples: Samples) -> ThresholdActions | None:
        """Compare measured values with the thresholds; None if none was crossed."""
        targets, news = self._thresholds.check_samples(samples)
        if not news:
            return None
        held = [Held(self._thresholds.held)] if any(one.holds for one in news) else []
        return self._threshold_actions(targets, [*held, *news])

    def _threshold_actions(self, targets: Mapping[Key, Any], news: list[FromWorker]) -> ThresholdActions:
        crossed = (one.device for one in news if isinstance(one, ThresholdCrossed))
        stopped = tuple(dict.fromkeys(device for device in crossed if device in self._thresholds.held))
        self.set_points.drop_courses(stopped)
        return ThresholdActions(stopped, targets, news)

    def _holding_threshold(self, device: Any) -> str:
        name = self._thresholds.held.get(device)
        return "" if name is None else f"held by {name}"
