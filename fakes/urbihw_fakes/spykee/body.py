"""The body: two tracks with inertia, its place in a room of four walls, its dock, its battery.

The room is 4 m by 3 m, its middle is (0, 0), x points to the red wall.  The robot begins in the middle, looking there;
its dock is at the opposite wall.  Tracks slip when it turns, so it turns more slowly than their distance says.
"""

from __future__ import annotations

import math

HALF_LENGTH, HALF_WIDTH = 2.0, 1.5
"""m from the middle to the walls in x and in y."""
RADIUS = 0.15
FULL_SPEED = 0.42
"""m/s of a track at 100."""
ACCELERATION = 1.2
"""m/s2 of a track, speeding up and slowing down."""
GAUGE = 0.24
"""m between the tracks."""
GRIP = 0.62
"""Share of the turn that the floor does not take away."""
STEP = 0.005
DOCK = (-HALF_LENGTH + 0.25, 0.0)
REACHED = 0.06
"""m from the dock at which it has it."""
LEAVING = 0.8
"""Seconds it drives forward off the dock."""
SEARCH_SPEED = 40.0
DRAIN, DRIVE_DRAIN, CHARGE = 0.002, 0.01, 0.05
"""Percent a second: standing, driving at full speed besides, on the dock."""


class Body:
    """Attributes: x, y (m), heading (rad), speeds and ways of the tracks (m/s, m), dock (where it is: m), docked, level
    (percent), doing ("", "docking" or "leaving"); `news` are the events of the dock that were not told yet: 1 undocked,
    2 docked."""

    def __init__(self) -> None:
        self.x = self.y = self.heading = 0.0
        self.dock = DOCK
        self.wanted = [0.0, 0.0]
        self.speeds = [0.0, 0.0]
        self.ways = [0.0, 0.0]
        self.docked = False
        self.level = 87.0
        self.doing = ""
        self.powered = True
        self.news: list[int] = []
        self._left_at = 0.0
        self._now: float | None = None

    # ---------------------------------------------------------------- its orders

    def drive(self, left: float, right: float) -> None:
        """Let the tracks run; on the dock it does not, and a search is over."""
        self.doing = ""
        self.wanted = [0.0, 0.0] if self.docked else [left, right]

    def find_dock(self) -> None:
        """Look for the dock."""
        if not self.docked:
            self.doing = "docking"

    def cancel(self) -> None:
        """Stop the look for the dock."""
        if self.doing:
            self.doing, self.wanted = "", [0.0, 0.0]

    def leave_dock(self, now: float) -> None:
        """Drive off the dock."""
        if self.docked:
            self.docked, self.doing, self._left_at = False, "leaving", now
            self.news.append(1)

    def place(self, x: float, y: float, heading: float) -> None:
        """A hand carries it there."""
        self.x, self.y, self.heading = x, y, heading
        self._keep_inside()

    def put_on_dock(self) -> None:
        """A hand puts it on its dock."""
        self.place(*self.dock, 0.0)
        self._dock()

    def cut_power(self) -> None:
        """It coasts, and forgets its orders."""
        self.powered, self.doing, self.wanted = False, "", [0.0, 0.0]

    # ---------------------------------------------------------------- time

    def advance(self, now: float) -> None:
        """Bring it to `now`."""
        at = now if self._now is None else self._now
        while at < now - 1e-9:
            step = min(STEP, now - at)
            at += step
            self._step(at, step)
        self._now = now

    def _step(self, now: float, dt: float) -> None:
        self._seek(now)
        for side in (0, 1):
            wanted = self.wanted[side] / 100 * FULL_SPEED if self.powered else 0.0
            change = min(max(wanted - self.speeds[side], -ACCELERATION * dt), ACCELERATION * dt)
            self.speeds[side] += change
            self.ways[side] += self.speeds[side] * dt
        left, right = self.speeds
        self.heading += (right - left) / GAUGE * GRIP * dt
        self.x += (left + right) / 2 * math.cos(self.heading) * dt
        self.y += (left + right) / 2 * math.sin(self.heading) * dt
        self._keep_inside()
        self._discharge(dt)

    def _seek(self, now: float) -> None:
        """Go on to the dock, or away from it."""
        if self.doing == "docking":
            self._steer()
        elif self.doing == "leaving":
            self.wanted = [SEARCH_SPEED, SEARCH_SPEED]
            if now - self._left_at > LEAVING:
                self.cancel()

    def _discharge(self, dt: float) -> None:
        left, right = self.speeds
        effort = (abs(left) + abs(right)) / 2 / FULL_SPEED
        change = CHARGE if self.docked else -(DRAIN + DRIVE_DRAIN * effort)
        self.level = min(100.0, max(0.0, self.level + change * dt)) if self.powered else self.level

    def _steer(self) -> None:
        dx, dy = self.dock[0] - self.x, self.dock[1] - self.y
        if math.hypot(dx, dy) < REACHED:
            self._dock()
            return
        off = math.remainder(math.atan2(dy, dx) - self.heading, math.tau)
        turn = max(-SEARCH_SPEED, min(SEARCH_SPEED, off * 60))
        ahead = SEARCH_SPEED if abs(off) < 0.4 else 0.0
        self.wanted = [ahead - turn, ahead + turn]

    def _dock(self) -> None:
        self.docked, self.doing = True, ""
        self.wanted, self.speeds = [0.0, 0.0], [0.0, 0.0]
        self.news.append(2)

    def _keep_inside(self) -> None:
        self.x = max(RADIUS - HALF_LENGTH, min(HALF_LENGTH - RADIUS, self.x))
        self.y = max(RADIUS - HALF_WIDTH, min(HALF_WIDTH - RADIUS, self.y))

    def power_byte(self) -> int:
        """The level as it is sent: percent, negative while it charges."""
        return round(-self.level if self.docked else self.level)
