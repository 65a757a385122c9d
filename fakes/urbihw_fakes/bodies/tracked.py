"""A Spykee whose tracks run in MuJoCo, and whose camera sees its world.

A track follows its set speed with the plain body's acceleration; what the floor makes of it is physics.  The
dock is at the site ``dock`` of the world, else 1 m behind the start.
"""

from __future__ import annotations

import math

from urbihw_fakes.bodies.simulation import Simulation
from urbihw_fakes.bodies.wheels import Wheels
from urbihw_fakes.spykee.body import ACCELERATION, FULL_SPEED, STEP, Body

RADIUS = 0.035
SUBSTEPS = 2
GAIN = 0.2
"""N m of a motor per rad/s."""
LONGEST_GAP = 10.0
"""s; a longer pause of the caller is no time for the body."""
_BEHIND = 1.0


class TrackedBody(Body):
    """A robot in a world; ``world`` as in ``simulation``.  Raises UnknownRequest."""

    def __init__(self, world: str) -> None:
        super().__init__()
        self.simulation = Simulation("spykee", world, STEP / SUBSTEPS)
        self.base = Wheels(self.simulation)
        x, y, heading = self.base.pose
        dock = self.simulation.place_in_world("dock")
        self.dock = dock if dock is not None else (x - _BEHIND * math.cos(heading), y - _BEHIND * math.sin(heading))
        self._planned = [0.0, 0.0]
        self._measure()

    def place(self, x: float, y: float, heading: float) -> None:
        self.put(x, y, heading)

    def put(self, x: float, y: float, heading: float) -> None:
        """A hand carries it there: m, m, rad."""
        self.base.put(x, y, heading)
        self._planned = [0.0, 0.0]
        self._measure()

    def advance(self, now: float) -> None:
        """As in ``Body``, in equal steps."""
        if self._now is None or now - self._now > LONGEST_GAP:
            self._now = now
        while self._now + STEP <= now + 1e-9:
            self._now += STEP
            self._step(self._now, STEP)

    def _step(self, now: float, dt: float) -> None:
        self._seek(now)
        for side in (0, 1):
            wanted = self.wanted[side] / 100 * FULL_SPEED if self.powered else 0.0
            change = ACCELERATION * dt
            self._planned[side] += max(-change, min(change, wanted - self._planned[side]))
        for _ in range(SUBSTEPS):
            pairs = zip(self._planned, self.base.speeds, strict=True)
            left, right = (GAIN * (planned / RADIUS - speed) if self.powered else 0.0 for planned, speed in pairs)
            self.base.drive(left, right)
            self.simulation.step()
        self._measure()
        self._discharge(dt)

    def _measure(self) -> None:
        self.x, self.y, self.heading = self.base.pose
        left, right = self.base.speeds
        self.speeds = [left * RADIUS, right * RADIUS]
        left, right = self.base.angles
        self.ways = [left * RADIUS, right * RADIUS]
