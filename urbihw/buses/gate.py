"""What every target and every request passes on its way to the driver of a wire; no I/O.

First the authority (is it of this epoch, does an emergency stop hold?), then the thresholds (is the device too hot to
move?), then the limits and the set points.  What asks for no motion passes the first two in any case.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from urbihw.buses.authority import STALE, Authority
from urbihw.buses.driver import Driver
from urbihw.buses.guards import Guards
from urbihw.buses.messages import FromWorker, Limits, Refused, Reply, Request, Samples, Targets
from urbihw.buses.setpoints import Key, SetPoints


@dataclass(frozen=True, slots=True)
class Measures:
    """What measured values ask for: devices to stop, targets to set, and the news."""

    stopped: tuple[Any, ...]
    targets: Mapping[Key, Any]
    news: list[FromWorker]


class Gate:
    """The gate of one wire.  Lists that are returned are messages to post.

    Attributes:
        authority: the epoch and the latch.
        set_points: the courses of the targets.
    """

    def __init__(self, driver: Driver, authority: Authority) -> None:
        self.authority = authority
        self.set_points = SetPoints(driver)
        self._driver = driver
        self._guards = Guards()

    def limit(self, message: Limits) -> None:
        """Take new limits and thresholds."""
        self.set_points.limit(message.table)
        self._guards.set(message.thresholds)

    def targets(self, message: Targets, now: float) -> tuple[dict[Key, Any], list[FromWorker]]:
        """Those of the targets that the driver gets at once, as the limits leave them."""
        news: list[FromWorker] = []
        refusal = self.authority.refusal(message.epoch)
        passed: dict[Key, Any] = {}
        for key, value in message.values.items():
            reason = refusal or self._held(key[0])
            if reason and self._driver.moves(*key, value):
                # That a stop has overtaken a target is no news to anybody.
                news += [] if reason is STALE else [Refused(*key, reason)]
            else:
                passed[key] = value
        given = self.set_points.take(passed, now, message.time, message.resumed)
        return given, news + [*self.set_points.news()]

    def request(self, message: Request) -> tuple[Request | None, list[FromWorker]]:
        """A request as the limits leave it; None, and an answer, if it may not be done now."""
        reason = self.authority.refusal(message.epoch) or self._held(message.device)
        if reason and self._driver.request_moves(message):
            return None, [Reply(message.reply_id, False, error=reason)]
        clamp = self.set_points.clamp
        for key, value in self._driver.implied(message).items():
            if clamp(*key, value) != value:
                limit = self.set_points.news()[-1:]
                why = f"it is beyond {limit[0].limit}" if limit else "it is beyond a limit"
                return None, [Reply(message.reply_id, False, error=why)]
        if message.verb == "write":
            message = replace(message, value=clamp(message.device, message.item, message.value))
        elif message.verb == "write_all":
            steps = tuple((item, clamp(message.device, item, value)) for item, value in message.value)
            message = replace(message, value=steps)
        return message, [*self.set_points.news()]

    def look(self, samples: Samples) -> Measures | None:
        """Look at measured values; None if nothing is to be done."""
        targets, news = self._guards.look(samples)
        if not news:
            return None
        stopped = tuple({one.device: None for one in news if one.device in self._guards.held})
        self.set_points.forget(stopped)
        return Measures(stopped, targets, [*news])

    def _held(self, device: Any) -> str:
        name = self._guards.held.get(device)
        return "" if name is None else f"held by {name}"
