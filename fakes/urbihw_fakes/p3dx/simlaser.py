"""The laser of MobileSim: controlled by the commands SIM_LRF_*, its scans are sent between the SIPs."""

from __future__ import annotations

import math

from urbihw_fakes.lasers.rays import distances
from urbihw_fakes.p3dx import numbers, sips
from urbihw_fakes.p3dx.body import Body
from urbihw_fakes.p3dx.codec import Command

FARTHEST = 32.0
CYCLE = 0.1


def scan(body: Body, first: float, last: float, step: float, farthest: float) -> list[float]:
    """Distances in m from the laser's place, from ``first`` to ``last`` counterclockwise."""
    count = round((last - first) / step) + 1
    return distances(body, [first + index * step for index in range(count)], farthest)


class SimLaser:
    """The laser as MobileSim simulates it."""

    COMMANDS = frozenset(
        {numbers.SIM_LRF_ENABLE, numbers.SIM_LRF_START, numbers.SIM_LRF_END, numbers.SIM_LRF_INCREMENT}
    )

    def __init__(self, body: Body) -> None:
        self._body = body
        self.mode = 0
        self._first, self._last, self._step = -90, 90, 1

    def execute_command(self, order: Command) -> None:
        """Execute one of COMMANDS."""
        if order.number == numbers.SIM_LRF_ENABLE:
            self.mode = order.value
        elif order.number == numbers.SIM_LRF_START:
            self._first = order.value
        elif order.number == numbers.SIM_LRF_END:
            self._last = order.value
        elif order.value > 0:
            self._step = order.value

    def bodies(self) -> list[bytes]:
        """The packets of one scan; none while it is off."""
        if not self.mode:
            return []
        first, last, step = (math.radians(value) for value in (self._first, self._last, self._step))
        ranges = [round(metres * 1000) for metres in scan(self._body, first, last, step, FARTHEST)]
        x, y, heading = self._body.pose
        pose = (round(x * 1000), round(y * 1000), round(math.degrees(heading)))
        return sips.sim_scan(pose, ranges, long=self.mode == 2)
