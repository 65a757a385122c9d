"""Set points: from the targets that are requested to those that the driver gets; no I/O.

A writer may request targets at any rate.  The driver's targets stay within the limits of the settings and change no
faster than the rate limits allow.  A device that was lost and comes back is where it stopped, not where its movement
has got to meanwhile: the set point starts at its position and catches up, no faster than the movement itself.  While
that position is unknown nothing is written: the target waits, and its newest value counts.

The set point of a position is bound to the body, too: while a speed is to be kept, by a limit or by the movement that
asks, it is never further ahead of the measured position than the device needs to follow at that speed
(``Driver.reach``).  A joint that is blocked is waited for, so it does not leap when it is free again.  The
same holds for a joint that stands: if it is forced away, its goal goes with it, and is led back when it is let go.

    asked    .-'-.     .-'-.        the requested course of the movement
    given    .-'--------'/..-'-.    constant while the device is lost, then led to the course at the course's own speed
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Any, Final

from urbihw.buses.driver import Driver, ImpliedTarget
from urbihw.buses.messages import Limit, Limited

Key = tuple[Any, str]

LIVE_TIMEOUT_S: Final = 0.25
"""Longest pause in s between two targets of one movement; a course without targets for longer is over."""
SPEED_WINDOW_S: Final = 2.0
"""Seconds over which the largest speed of a movement is determined."""
SPEED_BASE_S: Final = 0.06
"""Shortest time base of a speed in s: single targets change by whole counts, and arrive with some jitter."""
CATCH_UP_S: Final = 1.0
"""Seconds in which a set point catches up with a movement of unknown speed."""
LONGEST_STEP_S: Final = 0.03
"""Longest time step of a tick in s, where the ticks are not usually slower."""
SLOWEST_TICK_S: Final = 0.15
"""Longest time step in s on a slow wire, such as that of 18 servos at 57 600 baud: 0.11."""
_NO_LIMIT: Final = Limit()
_NO_RATES: Final[Mapping[Key, float]] = {}


class _Course:
    """The targets of one item: what was asked last, how fast that moves, and what was given."""

    __slots__ = ("_before", "_fastest", "_from", "_since", "asked", "asked_at", "given", "limit", "limited_to", "rate",
                 "returning")

    def __init__(self) -> None:
        self.asked = math.nan
        self.asked_at = -math.inf
        self.given = math.nan
        self.returning = False
        self.rate = math.inf
        self.limit = ""
        self.limited_to = math.nan
        self._from = (0.0, -math.inf)
        self._fastest = self._before = 0.0
        self._since = -math.inf

    def add_target(self, value: float, now: float, written: float, resumed: bool = False) -> None:
        """Record a target, ``written`` at a time of its writer's clock; ``resumed``: its writer was held up."""
        place, begun = self._from
        elapsed = written - begun
        if resumed:
            self._from = value, written
        elif now - self.asked_at > LIVE_TIMEOUT_S or elapsed > LIVE_TIMEOUT_S or elapsed < 0:
            self._fastest = self._before = 0.0
            self._since = written
            self._from = value, written
        elif elapsed >= SPEED_BASE_S:
            if written - self._since > SPEED_WINDOW_S:
                self._before, self._fastest, self._since = self._fastest, 0.0, written
            self._fastest = max(self._fastest, abs(value - place) / elapsed)
            self._from = value, written
        self.asked, self.asked_at = value, now

    def is_live(self, now: float) -> bool:
        """Return whether targets still arrive."""
        return now - self.asked_at <= LIVE_TIMEOUT_S

    def speed(self) -> float:
        """Return the largest recent speed of the course in counts/s, 0 if unknown."""
        return max(self._fastest, self._before)


_NO_COURSE: Final = _Course()


def _step(given: float, asked: float, far: float, bounds: tuple[float, float] | None) -> float:
    """Return the next target on the way to the one that is asked for, within bounds; nan while these are unknown."""
    way = asked - given
    step = asked if abs(way) <= far else given + math.copysign(far, way)
    if bounds is None:
        return step
    return math.nan if math.isnan(bounds[0]) else min(max(step, bounds[0]), bounds[1])


class SetPoints:
    """The courses of all items of one wire.

    Attributes:
        limits: the limits of targets by (device, item); ``set_limits`` replaces them.
    """

    def __init__(self, driver: Driver) -> None:
        """``driver`` knows the positions, and how counts are signed."""
        self._driver = driver
        self.limits: Mapping[Key, Limit] = {}
        self._courses: dict[Key, _Course] = {}
        self._under_way: dict[Key, None] = {}
        self._limited: tuple[Key, ...] = ()
        self._led: dict[Key, tuple[float, float]] = {}
        self._led_at = -math.inf
        self._paced: dict[Key, None] = {}
        self._stepped_at = -math.inf
        self._usual_step = 0.0
        self._news: list[Limited] = []

    def set_limits(self, table: Mapping[Key, Limit], now: float) -> dict[Key, Any]:
        """Replace all limits; return the targets that must change at once, since they are beyond the new ones.

        A joint that stands stays where it is; one on its way goes on within the new limits.
        """
        self.limits = table
        self._limited = tuple(key for key, limit in table.items() if limit.rate < math.inf)
        given: dict[Key, Any] = {}
        for key in self._courses.keys() & table.keys():
            course, limit = self._courses[key], table[key]
            is_joint = self._driver.pose(*key) is not None
            if math.isnan(course.asked) or (is_joint and not self._rein(key, course, now)):
                continue
            course.asked = self._apply_limit(key, course, limit, self._driver.raw_of(*key, course.asked))
            within = min(max(course.given, limit.low), limit.high)
            if within != course.given and not math.isnan(within):
                course.given = within
                given[key] = self._driver.raw_of(*key, within)
        return given

    def _rein(self, key: Key, course: _Course, now: float) -> bool:
        """Take the set point of a joint back to what it can follow; return whether the joint is on its way."""
        if key in self._under_way:
            return True
        if math.isnan(course.given):
            # It stands since its device came back: what was asked before is over.
            return False
        place, pace = self._driver.pose(*key), self._pace(key, course)
        bounds = self._driver.reach(*key, pace, now)
        if bounds is None:
            # Nothing tells how far its goal may be ahead: it was sent there at once, and is not there yet.
            far = pace * LIVE_TIMEOUT_S
            bounds = (math.nan, math.nan) if place is None else (place - far, place + far)
        if math.isnan(bounds[0]) or bounds[0] <= course.given <= bounds[1]:
            return False
        course.given = min(max(course.given, bounds[0]), bounds[1])
        self._set_under_way(key, now)
        return True

    def _pace(self, key: Key, course: _Course) -> float:
        """Return the speed to keep in counts/s: that of the limit, or of the movement if it is slower."""
        return min(self.limits.get(key, _NO_LIMIT).rate, course.rate)

    def _set_under_way(self, key: Key, now: float) -> None:
        if not self._under_way:
            self._stepped_at = now
        self._under_way[key] = None

    def drop_courses(self, devices: tuple[Any, ...] | None = None) -> None:
        """Drop the courses of the robot, or of some devices, which were stopped."""
        for key in (*self._courses, *self._led):
            if devices is None or key[0] in devices:
                self._drop(key)

    def _drop(self, key: Key) -> None:
        self._courses.pop(key, None)
        self._under_way.pop(key, None)
        self._paced.pop(key, None)
        self._led.pop(key, None)

    def _drop_rivals(self, key: Key) -> None:
        """A motor that was on its way to a place and now turns at a speed does not go on to that place."""
        if key[1] not in self._driver.exclusive:
            return
        for item in self._driver.exclusive:
            if item != key[1]:
                self._drop((key[0], item))

    def accept_targets(
        self,
        values: Mapping[Key, Any],
        now: float,
        written: float | None = None,
        resumed: Collection[Key] = (),
        rates: Mapping[Key, float] = _NO_RATES,
    ) -> dict[Key, Any]:
        """Accept requested targets; return those that the driver gets at once.  The others come from ``next_targets``.

        ``written`` is the time at which they were written, by the writer's clock; None: now.  ``resumed`` are targets
        of movements whose writer was held up: they are caught up with like those of a device that was lost.  ``rates``
        are the speeds of movements that tell theirs.
        """
        given: dict[Key, Any] = {}
        for key, raw in values.items():
            # What is no number ends what was under way, too: a motor that is let go does not go on.
            self._drop_rivals(key)
            if raw.__class__ is bool or not isinstance(raw, int | float) or math.isnan(raw):
                given[key] = raw
                continue
            course = self._courses.get(key)
            if course is None:
                course = self._courses[key] = _Course()
            limit = self.limits.get(key)
            wanted = float(raw) if limit is None else self._apply_limit(key, course, limit, raw)
            course.rate = rates.get(key, math.inf)
            self._led.pop(key, None)
            if course.rate < math.inf:
                self._paced[key] = None
            elif self._paced:
                self._paced.pop(key, None)
            held_up = key in resumed and course.speed() > 0 and course.rate == math.inf
            course.add_target(wanted, now, now if written is None else written, held_up)
            if held_up:
                self._start_catch_up(key, course, now)
            if key in self._under_way:
                continue
            if self._pace(key, course) < math.inf and self._start_ramp(key, course, now):
                continue
            course.given = wanted
            given[key] = raw if limit is None else self._raw_value(key, raw, wanted)
        return given

    def clamp_value(self, device: Any, item: str, raw: Any) -> Any:
        """Return a value that is written once, after its limits."""
        self._drop_rivals((device, item))
        limit = self.limits.get((device, item))
        if limit is None or raw.__class__ is bool or not isinstance(raw, int | float):
            return raw
        course = self._courses.setdefault((device, item), _Course())
        return self._raw_value((device, item), raw, self._apply_limit((device, item), course, limit, raw))

    def start_ramp(self, device: Any, item: str, raw: Any, now: float) -> Any | None:
        """Start a ramp to a value that is written once; return the value after its limits, None without a ramp."""
        key = device, item
        limit = self.limits.get(key)
        if limit is None or limit.rate == math.inf or raw.__class__ is bool or not isinstance(raw, int | float):
            return None
        if self.accept_targets({key: raw}, now):
            return None
        return self._driver.raw_of(*key, self._courses[key].asked)

    def find_exceeded_limit(self, target: ImpliedTarget) -> str:
        """Return the name of the limit that a target would exceed, "" if it may be written."""
        limit = self.limits.get((target.device, target.item))
        if limit is None:
            return ""
        value = self._driver.signed(target.device, target.item, target.value)
        if not limit.low <= value <= limit.high and (limit.low, limit.high) != (-math.inf, math.inf):
            return limit.name
        return (limit.rate_name or limit.name) if target.rate > limit.rate else ""

    def resume_courses(self, device: Any, now: float) -> None:
        """A device is back (None: all are): its movements continue from its position."""
        for key, course in self._courses.items():
            if device not in (None, key[0]):
                continue
            place = self._driver.pose(*key)
            if not course.is_live(now) or (place is None and key not in self._under_way):
                # Its writer has ended; a movement is never continued without its writer.
                self._under_way.pop(key, None)
                course.given = math.nan
                continue
            if place is None:
                # A speed begins at zero: the device was stopped when it came back.
                course.given, self._stepped_at = 0.0, now
            else:
                self._start_catch_up(key, course, now)

    def led_goals(self, now: float, still: bool) -> dict[Key, Any]:
        """Return the goals of joints that are forced away from where they stand: these go along with them.

        A joint that is let go is led back at its pace, or stays where it is while an emergency stop holds (``still``).
        """
        passed, self._led_at = min(max(0.0, now - self._led_at), SLOWEST_TICK_S), now
        news: dict[Key, Any] = {}
        for key in self._driver.joints() if still else (*self._limited, *self._paced):
            pace = 0.0 if still else self._pace(key, self._courses.get(key, _NO_COURSE))
            goal = None if key in self._under_way or pace == math.inf else self._driver.standing_goal(*key)
            if goal is None:
                self._led.pop(key, None)
                continue
            if math.isnan(goal):
                continue
            home, given = self._led.pop(key, (math.nan, math.nan))
            bounds = self._driver.reach(*key, pace, now)
            if math.isnan(given) or self._driver.raw_of(*key, given) != goal:
                given = goal
            if still or math.isnan(home):
                home = given
            step = _step(given, home, pace * passed, bounds)
            if step != home and not math.isnan(step):
                self._led[key] = home, step
            if not math.isnan(step) and (raw := self._driver.raw_of(*key, step)) != goal:
                news[key] = raw
        return news

    def next_targets(self, now: float) -> dict[Key, Any]:
        """Return the targets of this tick for all courses that have not reached their requested target."""
        if not self._under_way:
            return {}
        passed, self._stepped_at = max(0.0, now - self._stepped_at), now
        # A late tick must not make the step larger; the movement takes longer instead. Where each tick takes so long, a
        # movement keeps its time.
        elapsed = min(passed, max(LONGEST_STEP_S, self._usual_step))
        self._usual_step = min(passed, SLOWEST_TICK_S)
        given: dict[Key, Any] = {}
        for key in list(self._under_way):
            course = self._courses[key]
            if course.returning and not course.is_live(now):
                # Its writer has ended while it caught up: it stays at the last set point.
                del self._courses[key], self._under_way[key]
                continue
            if math.isnan(course.given) and not self._begin_at_position(key, course):
                continue
            way = course.asked - course.given
            pace = self._pace(key, course)
            if course.returning:
                pace = min(pace, course.speed() or abs(way) / CATCH_UP_S)
            bounds = self._driver.reach(*key, pace, now) if pace < math.inf else None
            step = _step(course.given, course.asked, pace * elapsed if elapsed else 0.0, bounds)
            if math.isnan(step):
                continue
            course.given = step
            given[key] = self._driver.raw_of(*key, course.given)
            if course.given == course.asked:
                course.returning = False
                del self._under_way[key]
        return given

    def paces(self, keys: Iterable[Key]) -> Mapping[Key, float]:
        """Return the highest speeds with which targets are to be reached, of those that are bounded, in counts/s."""
        if not self._limited and not self._paced:
            return _NO_RATES
        paces = ((key, self._pace(key, self._courses.get(key, _NO_COURSE))) for key in keys)
        return {key: pace for key, pace in paces if pace < math.inf}

    def pop_limited(self) -> list[Limited]:
        """Return the changes that limits made to targets since the last call."""
        news, self._news = self._news, []
        return news

    def _apply_limit(self, key: Key, course: _Course, limit: Limit, raw: Any) -> float:
        """Return a target after its limit; a message is queued when that changes, and when the limit is left."""
        asked = self._driver.signed(*key, raw)
        wanted = min(max(asked, limit.low), limit.high)
        name = limit.name if wanted != asked else ""
        if name != course.limit or (name and wanted != course.limited_to):
            course.limit, course.limited_to = name, wanted
            self._news.append(Limited(*key, raw, self._driver.raw_of(*key, wanted), name))
        return wanted

    def _raw_value(self, key: Key, raw: Any, wanted: float) -> Any:
        return raw if self._driver.signed(*key, raw) == wanted else self._driver.raw_of(*key, wanted)

    def _start_catch_up(self, key: Key, course: _Course, now: float) -> None:
        """Lead a device from its position to its course, no faster than the course itself moves.

        An unknown position (nan) is looked up by ``next_targets``, as often as it takes.
        """
        place = self._driver.pose(*key)
        if place is None:
            return
        course.given, course.returning = place, True
        self._set_under_way(key, now)

    def _begin_at_position(self, key: Key, course: _Course) -> bool:
        """Begin a course whose position was unknown at the position; False if that is still unknown."""
        place = self._driver.pose(*key)
        course.given = 0.0 if place is None else place
        return not math.isnan(course.given)

    def _start_ramp(self, key: Key, course: _Course, now: float) -> bool:
        """Start a ramp to a target; False if it is reached already."""
        place, pace = self._driver.pose(*key), self._pace(key, course)
        bounds = None if place is None else self._driver.reach(*key, pace, now)
        if bounds is not None:
            # In the middle, it pushes as hard as it does now: a joint that carries a weight does not give way.
            begin = sum(bounds) / 2 if math.isnan(course.given) else course.given
            course.given = min(max(begin, bounds[0]), bounds[1])
        elif place is None or math.isnan(course.given) or math.isnan(place):
            # A speed begins at rest.
            course.given = (0.0 if math.isnan(course.given) else course.given) if place is None else place
        elif abs(place - course.given) > pace * LIVE_TIMEOUT_S:
            # It was moved by something else: a ramp that began at the last target would send it there at full speed.
            course.given = place
        if course.given == course.asked:
            return False
        self._set_under_way(key, now)
        return True
