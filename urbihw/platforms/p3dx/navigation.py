"""The navigator of a Pioneer and what it works on, with the names that urbiscript knows: see ``urbihw.navigation``."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

from urbihw.navigation.base import Worker
from urbihw.navigation.navigator import Navigator
from urbihw.navigation.odometry import Odometry
from urbihw.navigation.sicklaser import SickLaser
from urbihw.platforms.p3dx.options import SIMULATED

SIMULATED_RANGE: Final = 32.0
"""m; what the laser of MobileSim reports where it hits nothing."""


class P3dxOdometry(Odometry):
    """``P3dx.body.odometry``"""


class P3dxPlanner(Navigator):
    """``P3dx.planner``"""

    slot_name = "P3dx.planner"


class P3dxLaser(SickLaser):
    """``P3dx.body.laser``: on a wire of its own, or that of MobileSim, whose scans come with the robot's packets."""

    slot_name = "P3dx.body.laser"

    def init(  # type: ignore[override]
        self, url: str, place: float, start_worker: Callable[..., Worker], watch: Callable[[bool], None], offset: float
    ) -> None:
        """``url`` may also be "sim"; ``watch`` switches the simulated laser.  The rest: see ``SickLaser``."""
        super().init(url, place, start_worker, offset)
        self._watch = watch

    def connect(self) -> None:
        """See ``RangeScanner``."""
        if not self.url:
            raise ValueError("this robot was given no laser; add ?laser=/dev/ttyUSB1 to its url")
        if self.url == SIMULATED:
            self._watch(True)
        else:
            super().connect()

    def disconnect(self) -> None:
        """See ``RangeScanner``."""
        if self.url == SIMULATED:
            self._watch(False)
        else:
            super().disconnect()

    def show_simulated_scan(self, millimetres: Sequence[int], stamp: float) -> None:
        """A scan of MobileSim's laser, whose step follows from the number of readings."""
        if self.wanted and len(millimetres) > 1:
            self.show_geometry(math.pi, math.pi / (len(millimetres) - 1))
            ranges = [value / 1000 if value < SIMULATED_RANGE * 1000 else math.inf for value in millimetres]
            self.show_scan(ranges, stamp, SIMULATED_RANGE)


def laser_url(option: str, *, simulator: bool) -> str:
    """Which laser there is: what the options say, or that of the simulator; "" for none."""
    return option or (SIMULATED if simulator else "")
