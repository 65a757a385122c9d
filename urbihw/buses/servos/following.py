"""How the shaft of a servo follows its goal, and how far the goal may be ahead of it.

A servo turns its error into drive: with an error of `full` it pushes as hard as it can, and without a load it follows
its goal `lag` seconds late. So a shaft that is let go, with its goal `speed * lag` ahead, turns at `speed`, and not at
the full speed that the motor has. That is the lead of a goal; to it comes what the shaft carries: the error with
which it holds a weight, or overcomes its friction. It is learnt while the shaft turns towards its goal, since then the
drive agrees with what pulls at it; while something blocks the shaft it never grows, so that nothing is wound up against
a hand, and it is forgotten as soon as the shaft turns faster than wanted, since what pulled has let go.

A shaft that gives way is pulled by a weight that is new, or by a hand; both look alike at first. Up to `HOLDS` of the
full error the goal stays, so that a weight is held (the servo "props" it). When the shaft stands, the goal is lowered:
with a weight the shaft follows at once, which proves it, and what it pulls with is carried from then on; against a
hand, which does not follow, the goal is lowered until it is only the lead ahead. A pull that is harder than `HOLDS`
gets slack: the goal goes with the shaft. So a joint that is forced away and let go is no faster than it may be.

Below `BREAKAWAY` of the full error a geared servo does not begin to turn at all, so no lead is smaller; a joint that is
let go may then be as fast as that error makes it, some 0.3 rad/s, even if less was asked for.
"""

from __future__ import annotations

import math
from typing import Final

WINDOW_S: Final = 0.03
"""Seconds over which the speed of a turning shaft is measured at least: a position is a whole count."""
STILL_S: Final = 0.2
"""Seconds after which a shaft that has not moved by MOVED counts stands."""
STALE_S: Final = 0.3
"""Seconds without a reading after which the speed is unknown."""
LEARN_S: Final = 0.1
"""Seconds in which a turning shaft tells what it carries."""
SLOWEST_S: Final = 0.15
"""Longest time between two readings, on a slow wire, for which a goal leads the shaft on."""
LONGEST_GUESS_S: Final = 0.05
"""Seconds for which a turning shaft is assumed to turn on; later than that its place is that of the last reading."""
MOVED: Final = 2
"""Counts that are a motion: a sensor may flicker by one."""
BREAKAWAY: Final = 0.05
"""Share of the full error below which a servo may not begin to turn."""
HOLDS: Final = 0.5
"""Share of the full error up to which a shaft that gives way may be pulled by a weight."""
SETTLED_S: Final = 0.06
"""Seconds after which a shaft that gives way no further is tested for what pulls at it."""
TEST_S: Final = 0.2
"""Seconds in which the goal of a test goes the way of HOLDS."""
LONGEST_TEST_S: Final = 0.025
"""Longest step of a test in s, however rare the readings are."""
ANSWER_S: Final = 0.12
"""Seconds after the last step of a test in which a weight lowers the shaft."""
PROOF: Final = 3
"""Counts by which a weight lowers a shaft at least when its goal is lowered."""
FOLLOWED: Final = 0.3
"""Share of the way of the goal that it goes at least with a weight."""
MARGIN: Final = 1.25
"""How much more than its lead an error must be to tell of a pull."""
SLOWED: Final = 0.8
"""Share of the wanted speed below which what a shaft carries slows it down."""
TOO_FAST: Final = 1.2
"""How much faster than wanted a shaft turns when what it carried has let go."""
GRAIN: Final = 100.0
"""Counts per second by which a measured speed may be wrong."""
SURE: Final = 10
"""Counts that tell a speed in a shorter time than WINDOW_S."""
SHARE: Final = 0.15
"""Share of the full error with which a shaft that stands at its goal never pushes: friction and margins are less."""
ROUNDING: Final = 1.0
"""Counts by which a goal and a reading may be wrong."""


class _Prop:
    """A goal that stays where it is although the shaft gives way, and the test of what pulls at the shaft.

    Attributes:
        goal: that goal, in a test lowered.
        side: the direction from the shaft to it, 1.0 or -1.0.
        weight: the error with which the shaft stood when the test began.
    """

    __slots__ = ("_begun", "_place", "_since", "goal", "side", "weight")
    # `_since`: of the last reading with which it gave way further, in a test: of the last step.

    def __init__(self, goal: float, side: float, place: float, at: float) -> None:
        self.goal, self.side = goal, side
        self._place, self._since = place, at
        self._begun: float | None = None
        self.weight = 0.0

    @property
    def is_tested(self) -> bool:
        """Whether the goal is being lowered."""
        return self._begun is not None

    def test(self, place: float, at: float, step: float, rest: float, lead: float) -> str:
        """Go on with the test, a reading later; return "weight" or "hand" when it has told, "" before that.

        `step` is how far the goal may be lowered now, `rest` the goal without that pull, `lead` that of the shaft.
        """
        gave = self.side * (self._place - place)
        if self._begun is None:
            if gave >= MOVED:
                self._place, self._since = place, at
            elif at - self._since >= SETTLED_S:
                self._begun, self._place, self.weight = self.goal, place, self.goal - place
            return ""
        lowered = abs(self._begun - self.goal)
        if gave >= max(PROOF, FOLLOWED * lowered):
            return "weight"
        ahead = self.side * (self.goal - rest)
        if ahead <= 0 or (ahead <= lead and lowered >= PROOF / FOLLOWED):
            return "hand" if at - self._since >= ANSWER_S else ""
        self.goal -= self.side * step
        self._since = at
        return ""


class ServoFollower:
    """One shaft; positions are raw counts, speeds counts per second.

    Attributes:
        speed: as measured, 0 while it is unknown.
        carried: the error with which it carries what pulls at it.
        disturbed_since: the time since when it gives way to something, None while it does not.
    """

    def __init__(self, lag: float, full: float) -> None:
        """`lag` in seconds, `full` in counts."""
        self._lag = lag
        self._full = full
        self.forget()

    def forget(self) -> None:
        """Begin anew: the servo was off, or did not answer, and may have been turned by hand."""
        self.speed = 0.0
        self.carried = 0.0
        self.disturbed_since: float | None = None
        self._stands = False
        self._slack = 0.0
        self._pace = self._lead = float("inf")
        self._prop: _Prop | None = None
        self._base: tuple[float, float] | None = None
        self._last = 0.0
        self._led_at = -math.inf
        self._read_at = self._pause = self._pause_before = 0.0

    def add_reading(self, place: float, at: float, goal: float | None) -> None:
        """Take a measured position; `goal` is the last one sent to the servo, None if it is unknown."""
        self._pause_before, self._pause, self._read_at = self._pause, at - self._read_at, at
        last, self._last = self._last, place
        if self._base is None or at - self._base[1] > STALE_S:
            self._base, self.speed, self._stands = (place, at), 0.0, False
            return
        if abs(place - last) >= SURE and self._pause > 0:
            self._base = last, at - self._pause
        before, begun = self._base
        elapsed, turns = at - begun, abs(place - before) >= MOVED
        measured = elapsed >= (WINDOW_S if turns else STILL_S) or abs(place - before) >= SURE
        if measured:
            self._base = place, at
            self.speed = (place - before) / elapsed if turns else 0.0
            self._stands = not turns
        if at - self._led_at > STALE_S:
            # Its goal is not bound to it: the servo itself decides how fast it goes, so the error tells nothing.
            self._pace = self._lead = math.inf
            self._prop = None
            self._take_up()
        if goal is None:
            return
        error = min(max(goal - place, -self._full), self._full)
        if self._lead == math.inf:
            if measured and self._stands:
                self._bound_carried(error)
            return
        pull = error - self.speed * self._lag
        if measured:
            self._learn(error, pull, elapsed)
        self._look_for_pull(goal, place, error, pull)

    def _learn(self, error: float, pull: float, elapsed: float) -> None:
        """Learn what the shaft carries while it turns to its goal; one that stands can only tell that that is less."""
        if self.carried * self.speed > 0 and self._is_too_fast():
            # What it carried has let go.
            self.carried = min(max(pull, min(self.carried, 0.0)), max(self.carried, 0.0))
        elif self.speed:
            drives = (error - self.carried) * self.speed > 0
            more = pull - self.carried
            # At its full speed it needs no more; against the drive, it may be a hand that pulls more.
            grows = more * self.carried >= 0
            if (drives and abs(self.speed) < SLOWED * self._pace) if grows else (drives or not self._slack):
                carried = self.carried + more * min(1.0, elapsed / LEARN_S)
                self.carried = min(max(carried, -self._full), self._full)
            if drives:
                self._take_up()
        elif self._stands and self._slack:
            # A hand holds it, and what it carries, too.
            return
        elif self._stands:
            self._bound_carried(error)

    def _bound_carried(self, error: float) -> None:
        """It stands with this error, so it carries no more than that, and nothing on the other side."""
        if error >= 0:
            self.carried = min(max(self.carried, 0.0), error)
        else:
            self.carried = max(min(self.carried, 0.0), error)

    def _is_too_fast(self) -> bool:
        return abs(self.speed) > TOO_FAST * self._pace + GRAIN

    def _look_for_pull(self, goal: float, place: float, error: float, pull: float) -> None:
        """Tell a weight that is new from a hand, when the shaft gives way by more than its lead."""
        prop = self._prop
        if prop is not None and prop.side * (prop.goal - goal) > ROUNDING:
            # A movement has brought the goal nearer: that one holds the shaft, and only its lowering would tell. What
            # the shaft carried before something pulled it away is in doubt, too.
            self._prop = _Prop(goal, prop.side, place, self._read_at)
            self.carried = min(max(self.carried, -self._lead), self._lead)
        unknown = pull - self.carried
        let_go = unknown * self.speed > 0 and self._is_too_fast()
        if self._prop is not None and self._prop.is_tested and not let_go:
            self._test_prop(self._prop, place)
        elif abs(unknown) <= self._lead or let_go:
            self._prop = None
            if abs(unknown) <= self._lead / 2:
                self.disturbed_since = None
        elif unknown * self.speed <= 0:
            self._give_way(goal, place, error, unknown)

    def _give_way(self, goal: float, place: float, error: float, unknown: float) -> None:
        side = math.copysign(1.0, unknown)
        if self.disturbed_since is None and abs(unknown) > MARGIN * self._lead + MOVED:
            self.disturbed_since = self._read_at
        if abs(error) > max(HOLDS * self._full, abs(self.carried) + MARGIN * self._lead):
            self._prop, self._slack = None, side
        elif self._prop is not None:
            self._test_prop(self._prop, place)
        elif self._slack != side and unknown * self.speed < 0:
            self._prop, self._slack = _Prop(goal, side, place, self._read_at), 0.0

    def _test_prop(self, prop: _Prop, place: float) -> None:
        step = HOLDS * self._full / TEST_S * min(self._pause, LONGEST_TEST_S)
        told = prop.test(place, self._read_at, step, place + self.carried, self._lead)
        if told:
            self._prop = None
        if told == "weight":
            self.carried = prop.weight
            self._take_up()
        elif told == "hand":
            self._slack = prop.side

    def _take_up(self) -> None:
        """Nothing unknown pulls any more: what pulls next may be a weight."""
        self._slack, self.disturbed_since = 0.0, None

    def is_blocked(self, place: float, goal: float) -> bool:
        """Return whether the shaft stands although its goal is away by more than it carries."""
        away = abs(goal - place - self.carried)
        least = min(self._lead, SHARE * self._full) if self._lead < math.inf else HOLDS * self._full
        is_tested = self._prop is not None and self._prop.is_tested
        return self._stands and (is_tested or away >= max(0.9 * least, MOVED))

    def rest(self, place: float, goal: float | None) -> float:
        """Return the goal with which a shaft at `place` stays there: one that gives way keeps the goal that it has.

        `goal` is the last one sent to the servo, None if it is unknown; a movement may have left the propped one.
        """
        prop = self._prop
        if prop is None or self.disturbed_since is None:
            return place + self.carried
        return prop.goal if goal is None or prop.side * (goal - prop.goal) > 0 else goal

    def reach(self, place: float, age: float, pace: float, push: float = BREAKAWAY) -> tuple[float, float]:
        """Return the lowest and the highest goal for a shaft that was at `place` some seconds ago.

        `pace` is the highest speed that is wanted, `push` the share of the full error that is allowed at any speed.
        """
        turned = min(max(self.speed, -pace), pace) * min(age, LONGEST_GUESS_S)
        middle = place + turned + self.carried
        # A goal must last until the next one; of two pauses the shorter, since one reading may be late.
        pause = min(self._pause, self._pause_before, SLOWEST_S)
        self._pace, self._led_at = pace, self._read_at
        lead = max(pace * max(self._lag, pause), push * self._full) + ROUNDING
        # One that is to stand still has to settle.
        lead = self._lead = lead if pace else lead + MOVED
        low, high = middle - lead, middle + lead
        if self._prop is None:
            return low, high
        goal = self._prop.goal
        if self._prop.is_tested:
            return (min(low, goal), goal) if self._prop.side > 0 else (goal, max(high, goal))
        return min(low, goal), max(high, goal)
