"""The courses of joints that are commanded by dated points; no I/O.

Goals arrive with the time at which they are due.  Each cycle sends the points of the next moments only (up to a
horizon), so that a worker that dies leaves no more than that.  A joint is never asked to be faster than its speed, nor,
after a delay, faster than twice the course itself: a goal that comes late, or is far away, is reached later.  No point
is dated in the past but the first one of a course, which is where the joint is already.

Times are seconds of the worker's clock, positions rad.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

LIVE_S: Final = 0.5
"""Seconds after its last goal for which a joint keeps its place in the message of each cycle."""
MOST_GOALS: Final = 256
"""Goals of one joint that may wait; then the oldest ones are dropped."""
CATCH_UP: Final = 2.0
"""How much faster than its writer a course that is late goes on."""
LATE_S: Final = 1.0
"""A goal that is later than that is left out when the next one is as late."""
_SAME_S: Final = 0.001
"""The dates of the DCM are no finer."""

Point = tuple[float, float]
"""When, and where."""


class JointCourse:
    """The course of one joint.

    Attributes:
        ends_at, place: the last point that was sent: when it is due, and where the joint is then.
    """

    __slots__ = ("_due", "_goals", "_speed", "_wrote_at", "ends_at", "place")

    def __init__(self, place: float, speed: float, now: float) -> None:
        """A joint that is at ``place`` and moves at most at ``speed``, rad/s."""
        self.place, self.ends_at = place, now
        self._speed = speed
        self._goals: deque[Point] = deque(maxlen=MOST_GOALS)
        self._due = -math.inf
        self._wrote_at = now

    def add_goal(self, due: float, goal: float, now: float) -> None:
        """The joint is to be at ``goal`` at the time ``due``, or as soon as it can."""
        self._goals.append((due, goal))
        self._wrote_at = now

    def drop_goals(self) -> None:
        """Forget what was not sent."""
        self._goals.clear()

    def is_live(self, now: float) -> bool:
        """Whether there is something to send, or has been a short time ago."""
        return bool(self._goals) or now - self._wrote_at <= LIVE_S

    def moves_until(self, now: float) -> bool:
        """Whether points lie ahead, or goals wait."""
        return bool(self._goals) or self.ends_at > now

    def begin_anew(self, place: float, now: float) -> Point:
        """The points that were sent have run out: the course goes on from ``place``; return its first point."""
        self.place, self.ends_at = place, now
        return now, place

    def pop_points(self, horizon: float) -> list[Point]:
        """The points up to ``horizon`` that were not sent yet.  A goal behind it is approached as far as that."""
        goals, points = self._goals, []
        while goals and self.ends_at < horizon:
            while len(goals) > 1 and goals[1][0] < self.ends_at - LATE_S:
                goals.popleft()
            due, goal = goals[0]
            way, gap = goal - self.place, due - self._due
            least = max(abs(way) / self._speed, gap / CATCH_UP if 0 < gap <= LIVE_S else 0.0)
            arrival = max(due, self.ends_at + least)
            if arrival <= horizon + _SAME_S:
                goals.popleft()
                self.ends_at, self.place, self._due = arrival, goal, due
            else:
                share = (horizon - self.ends_at) / (arrival - self.ends_at)
                self.place += way * share
                self.ends_at = horizon
                if least and gap <= LIVE_S:
                    self._due += gap * share
            points.append((self.ends_at, self.place))
        return points
