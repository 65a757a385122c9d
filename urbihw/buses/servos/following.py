"""How the shaft of a servo follows its goal, and how far the goal may be ahead of it.

A servo turns its error into drive: with an error of `full` it pushes as hard as it can, and without a load it follows
its goal `lag` seconds late. So a shaft that is let go, with its goal `speed * lag` ahead, turns at `speed`, and not at
the full speed that the motor has. That is the lead of a moving goal; to it comes what the shaft carries: the error with
which it holds a weight, or overcomes its friction. It is learnt while the shaft turns, since then the drive agrees with
what pulls at it, and while it gives way, since then something pulls harder; while something blocks the shaft it never
grows, so that nothing is wound up against a hand.

Below `BREAKAWAY` of the full error a geared servo does not begin to turn at all, so no lead is smaller; a joint that is
let go may then be as fast as that error makes it, some 0.3 rad/s, even if less was asked for.
"""

from __future__ import annotations

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
SHARE: Final = 0.15
"""Share of the full error with which a shaft that stands at its goal never pushes: friction and margins are less."""
ROUNDING: Final = 1.0
"""Counts by which a goal and a reading may be wrong."""


class ServoFollower:
    """One shaft; positions are raw counts, speeds counts per second.

    Attributes:
        speed: as measured, 0 while it is unknown.
    """

    def __init__(self, lag: float, full: float) -> None:
        """`lag` in seconds, `full` in counts."""
        self._lag = lag
        self._full = full
        self.forget()

    def forget(self) -> None:
        """Begin anew: the servo was off, or did not answer, and may have been turned by hand."""
        self.speed = 0.0
        self._stands = False
        self._carried = 0.0
        self._lead = float("inf")
        self._base: tuple[float, float] | None = None
        self._read_at = self._pause = self._pause_before = 0.0

    def add_reading(self, place: float, at: float, goal: float | None) -> None:
        """Take a measured position; `goal` is the last one sent to the servo, None if it is unknown."""
        self._pause_before, self._pause, self._read_at = self._pause, at - self._read_at, at
        if self._base is None or at - self._base[1] > STALE_S:
            self._base, self.speed, self._stands = (place, at), 0.0, False
            return
        before, begun = self._base
        elapsed = at - begun
        turns = abs(place - before) >= MOVED
        if elapsed < (WINDOW_S if turns else STILL_S):
            return
        self._base = place, at
        self.speed = (place - before) / elapsed if turns else 0.0
        self._stands = not turns
        if goal is not None:
            self._learn(goal - place, turns, elapsed)

    def _learn(self, error: float, turns: bool, elapsed: float) -> None:
        """Learn from the error of a turning shaft; one that stands can only tell that it carries less."""
        if turns and error * self.speed < 0:
            # It gives way: it carries at least what this error pushes with.
            self._carried = max(self._carried, error) if error > 0 else min(self._carried, error)
            self._carried = min(max(self._carried, -self._full), self._full)
        elif turns:
            carried = self._carried + (error - self.speed * self._lag - self._carried) * min(1.0, elapsed / LEARN_S)
            self._carried = min(max(carried, -self._full), self._full)
        elif error >= 0:
            self._carried = min(max(self._carried, 0.0), error)
        else:
            self._carried = max(min(self._carried, 0.0), error)

    def is_blocked(self, place: float, goal: float) -> bool:
        """Return whether the shaft stands although its goal is away by more than it carries."""
        away = abs(goal - place - self._carried)
        return self._stands and away >= max(0.9 * min(self._lead, SHARE * self._full), MOVED)

    def reach(self, place: float, age: float, pace: float, push: float = BREAKAWAY) -> tuple[float, float]:
        """Return the lowest and the highest goal for a shaft that was at `place` some seconds ago.

        `pace` is the highest speed that is wanted, `push` the share of the full error that is allowed at any speed.
        """
        turned = min(max(self.speed, -pace), pace) * min(age, LONGEST_GUESS_S)
        middle = place + turned + self._carried
        # A goal must last until the next one; of two pauses the shorter, since one reading may be late.
        pause = min(self._pause, self._pause_before, SLOWEST_S)
        lead = self._lead = max(pace * max(self._lag, pause), push * self._full) + ROUNDING
        return middle - lead, middle + lead
