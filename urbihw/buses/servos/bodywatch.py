"""What the joints of a bus do against what they were told: a joint that is blocked, and one that is too fast.

Each is a `DeviceReport`: "blocked" with the time since when, "free" with the seconds that it was blocked, "overspeed"
with the speed in rad/s, "relaxed" with the reason. What is to be done about it is left to the options: a joint is
stopped, or gets slack.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from urbihw.buses.messages import DeviceReport, FromWorker, Limit
from urbihw.buses.servos.item import ShaftMotion
from urbihw.buses.servos.member import GOAL, Member
from urbihw.buses.servos.options import ServoBusOptions
from urbihw.buses.servos.plan import TORQUE

BLOCKED_S: Final = 0.5
"""Seconds for which a joint must stand away from its goal before it counts as blocked."""
OVER_S: Final = 0.1
"""Seconds for which a joint must be too fast before that is reported."""
MARGIN: Final = 1.2
"""How much faster than its limit a joint may be: a speed is measured in whole counts."""
COUNTS_S: Final = 60.0
"""Counts per second by which a measured speed may be wrong."""


@dataclass(slots=True)
class BodyFindings:
    """What one look has found: reports to post, devices to stop, with the reasons, and those that get slack before."""

    reports: list[FromWorker] = field(default_factory=list)
    stopped: dict[int, str] = field(default_factory=dict)
    slack: list[int] = field(default_factory=list)


class BodyWatch:
    """The watch over the joints of one bus.

    Attributes:
        limits: the limits of targets, by (device, item).
        options: those of the settings.
    """

    def __init__(self) -> None:
        self.limits: Mapping[tuple[Any, str], Limit] = {}
        self.options = ServoBusOptions()
        self._away: dict[int, float] = {}
        self._blocked: dict[int, float] = {}
        self._handled: set[int] = set()
        self._over: dict[int, float] = {}

    def look(self, members: Iterable[Member], now: float) -> BodyFindings:
        """Judge the joints by their last readings."""
        found = BodyFindings()
        for member in members:
            mode = member.device.mode
            if mode is None or mode.motion is ShaftMotion.POSITION:
                self._look_for_block(member, now, found)
                self._look_for_speed(member, now, found)
        return found

    def _look_for_block(self, member: Member, now: float, found: BodyFindings) -> None:
        number, since = member.device.id, math.inf
        if _is_blocked(member):
            since = self._away.setdefault(number, now)
        else:
            self._away.pop(number, None)
        if now - since < BLOCKED_S:
            begun = self._blocked.pop(number, None)
            self._handled.discard(number)
            if begun is not None:
                found.reports.append(DeviceReport(number, "free", round(now - begun, 3)))
            return
        if number not in self._blocked:
            self._blocked[number] = since
            found.reports.append(DeviceReport(number, "blocked", since))
        limit = self.options.blocked_limit
        if limit and now - since >= limit and number not in self._handled:
            self._handled.add(number)
            reason = f"motor {number} was blocked for {now - since:.1f} s"
            found.stopped[number] = reason
            if self.options.blocked_action == "relax":
                found.slack.append(number)
                found.reports.append(DeviceReport(number, "relaxed", reason))

    def _look_for_speed(self, member: Member, now: float, found: BodyFindings) -> None:
        number = member.device.id
        limit = self.limits.get((number, GOAL))
        speed = abs(member.follower.speed)
        if limit is None or speed <= limit.rate * MARGIN + COUNTS_S:
            self._over.pop(number, None)
            return
        if not member.moved:
            return
        begun = self._over.setdefault(number, now)
        if begun <= now - OVER_S:
            self._over[number] = math.inf
            fast = speed * member.count
            found.reports.append(DeviceReport(number, "overspeed", round(fast, 3)))
            if self.options.overspeed == "stop":
                name = limit.rate_name or limit.name
                found.stopped[number] = f"motor {number} turned at {fast:.1f} rad/s, above {name}"


def _is_blocked(member: Member) -> bool:
    """Return whether something keeps a joint from its goal."""
    goal, limp = member.written.get(GOAL), member.written.get(TORQUE) == 0 or bool(member.limp_by)
    # A suspect one is judged by its last reading: a missed one moves no joint.
    is_heard = member.health.state in ("ok", "suspect")
    if goal is None or limp or not member.moved or member.place is None or not is_heard:
        return False
    return member.follower.is_blocked(member.place, goal)
