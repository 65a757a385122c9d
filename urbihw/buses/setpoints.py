"""What lies between the targets that are asked for and those that a driver is given; no I/O.

A target is asked for as often as its writer likes.  What the driver gets stays within the limits of the settings, and
it changes no faster than they allow.  A device that was lost and comes back is where it is, not where its movement has
got to meanwhile: the movement is taken up from there, no faster than it goes by itself, until it has caught up.

    asked    .-'-.     .-'-.        the course of the movement
    given    .-'--------'/..-'-.    held while the device is lost, then brought nearer at the course's own speed
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any, Final, Protocol

from urbihw.buses.messages import Limit, Limited

Key = tuple[Any, str]

LIVE: Final = 0.25
"""Seconds between two targets up to which they belong to one movement."""
WINDOW: Final = 2.0
"""Seconds over which the speed of a movement is looked at."""
BASE: Final = 0.06
"""Seconds over which a speed is measured at least: single targets jump by whole counts, and come a little late."""
CATCH_UP: Final = 1.0
"""Seconds in which a movement is caught up with whose own speed is not known."""
LONGEST_STEP: Final = 0.03
"""Seconds that a tick may stand for."""
_NO_LIMIT: Final = Limit()


class _Course:
    """The targets of one item: what was asked last, how fast that moves, and what was given."""

    __slots__ = ("_before", "_fastest", "_from", "_since", "asked", "asked_at", "given", "limit", "limited_to",
                 "returning")

    def __init__(self) -> None:
        self.asked = math.nan
        self.asked_at = -math.inf
        self.given = math.nan
        self.returning = False
        self.limit = ""
        self.limited_to = math.nan
        self._from = (0.0, -math.inf)
        self._fastest = self._before = 0.0
        self._since = -math.inf

    def ask(self, value: float, now: float, written: float, resumed: bool = False) -> None:
        """A target came, ``written`` at a time of its writer's clock; ``resumed``: who was held up."""
        place, begun = self._from
        elapsed = written - begun
        if resumed:
            self._from = value, written
        elif now - self.asked_at > LIVE or elapsed > LIVE or elapsed < 0:
            self._fastest = self._before = 0.0
            self._since = written
            self._from = value, written
        elif elapsed >= BASE:
            if written - self._since > WINDOW:
                self._before, self._fastest, self._since = self._fastest, 0.0, written
            self._fastest = max(self._fastest, abs(value - place) / elapsed)
            self._from = value, written
        self.asked, self.asked_at = value, now

    def is_live(self, now: float) -> bool:
        """Whether targets still come."""
        return now - self.asked_at <= LIVE

    def speed(self) -> float:
        """How fast the course goes at most, in counts a second; 0 if that is not known."""
        return max(self._fastest, self._before)


class Wire(Protocol):
    """What is asked of a driver."""

    def pose(self, device: Any, item: str) -> float | None:
        """Where the device is, in the unit of the target; None for an item that is no place."""
        ...

    def signed(self, device: Any, item: str, raw: Any) -> float:
        """A target as a number that grows with what it asks for."""
        ...

    def raw_of(self, device: Any, item: str, signed: float) -> Any:
        """The target of such a number."""
        ...


class SetPoints:
    """The courses of all items of one wire."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        self._limits: Mapping[Key, Limit] = {}
        self._courses: dict[Key, _Course] = {}
        self._under_way: dict[Key, None] = {}
        self._stepped_at = -math.inf
        self._news: list[Limited] = []

    def limit(self, table: Mapping[Key, Limit]) -> None:
        """Take new limits."""
        self._limits = table

    def forget(self, devices: tuple[Any, ...] | None = None) -> None:
        """The robot, or a part of it, was stopped: no course is left."""
        for key in list(self._courses):
            if devices is None or key[0] in devices:
                del self._courses[key]
                self._under_way.pop(key, None)

    def take(
        self,
        values: Mapping[Key, Any],
        now: float,
        written: float | None = None,
        resumed: Collection[Key] = (),
    ) -> dict[Key, Any]:
        """Targets are asked for: what the driver gets at once.  The rest comes from ``step``.

        ``written`` is when they were, by the clock of who did; as it is now, if that is not known.  ``resumed`` are
        those of movements whose writer was held up: they are taken up like those of a device that was lost.
        """
        given: dict[Key, Any] = {}
        for key, raw in values.items():
            if raw.__class__ is bool or not isinstance(raw, int | float):
                given[key] = raw
                continue
            course = self._courses.get(key)
            if course is None:
                course = self._courses[key] = _Course()
            limit = self._limits.get(key)
            wanted = float(raw) if limit is None else self._limited(key, course, limit, raw)
            held_up = key in resumed and course.speed() > 0
            course.ask(wanted, now, now if written is None else written, held_up)
            if held_up:
                self._take_up(key, course, now)
            if key in self._under_way:
                continue
            if limit is not None and limit.rate < math.inf and self._begin(key, course, now):
                continue
            course.given = wanted
            given[key] = raw if limit is None else self._raw(key, raw, wanted)
        return given

    def clamp(self, device: Any, item: str, raw: Any) -> Any:
        """What the limits leave of something that is written once."""
        limit = self._limits.get((device, item))
        if limit is None or raw.__class__ is bool or not isinstance(raw, int | float):
            return raw
        course = self._courses.setdefault((device, item), _Course())
        return self._raw((device, item), raw, self._limited((device, item), course, limit, raw))

    def returned(self, device: Any, now: float) -> None:
        """A device is back, None for all: its movements are taken up from where it is."""
        for key, course in self._courses.items():
            if device not in (None, key[0]):
                continue
            place = self._wire.pose(*key)
            if not course.is_live(now) or (place is None and key not in self._under_way):
                # Nobody moves it any more; what was still on its way to a target is not taken up by itself.
                self._under_way.pop(key, None)
                course.given = math.nan
                continue
            if place is None:
                # A speed begins at zero, where the stop on return has left it.
                course.given, self._stepped_at = 0.0, now
            else:
                self._take_up(key, course, now)

    def step(self, now: float) -> dict[Key, Any]:
        """A tick: the targets of what is still on its way to what was asked."""
        if not self._under_way:
            return {}
        # A tick that comes late makes the way longer, not the step larger.
        elapsed, self._stepped_at = min(max(0.0, now - self._stepped_at), LONGEST_STEP), now
        given: dict[Key, Any] = {}
        for key in list(self._under_way):
            course = self._courses[key]
            if course.returning and not course.is_live(now):
                # Nobody moves it any more: it stays where it has got to.
                del self._courses[key], self._under_way[key]
                continue
            way = course.asked - course.given
            pace = self._limits.get(key, _NO_LIMIT).rate
            if course.returning:
                pace = min(pace, course.speed() or abs(way) / CATCH_UP)
            reach = pace * elapsed
            course.given = course.asked if abs(way) <= reach else course.given + math.copysign(reach, way)
            given[key] = self._wire.raw_of(*key, course.given)
            if course.given == course.asked:
                course.returning = False
                del self._under_way[key]
        return given

    def news(self) -> list[Limited]:
        """What limits made of targets since the last call."""
        news, self._news = self._news, []
        return news

    def _limited(self, key: Key, course: _Course, limit: Limit, raw: Any) -> float:
        """What a limit leaves of a target; it is told when that changes, and when the limit is left."""
        asked = self._wire.signed(*key, raw)
        wanted = min(max(asked, limit.low), limit.high)
        name = limit.name if wanted != asked else ""
        if name != course.limit or (name and wanted != course.limited_to):
            course.limit, course.limited_to = name, wanted
            self._news.append(Limited(*key, raw, self._wire.raw_of(*key, wanted), name))
        return wanted

    def _raw(self, key: Key, raw: Any, wanted: float) -> Any:
        return raw if self._wire.signed(*key, raw) == wanted else self._wire.raw_of(*key, wanted)

    def _take_up(self, key: Key, course: _Course, now: float) -> None:
        """Lead a device from where it is to its course, no faster than that goes."""
        place = self._wire.pose(*key)
        if place is None:
            return
        course.given, course.returning = place, True
        if not self._under_way:
            self._stepped_at = now
        self._under_way[key] = None

    def _begin(self, key: Key, course: _Course, now: float) -> bool:
        """Let a target be reached step by step; false if it is there already."""
        if math.isnan(course.given):
            place = self._wire.pose(*key)
            course.given = 0.0 if place is None else place
        if course.given == course.asked:
            return False
        if not self._under_way:
            self._stepped_at = now
        self._under_way[key] = None
        return True
