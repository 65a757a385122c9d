"""The odometry, planner and laser of a Pioneer, for ``urbihw.navigation``."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, Protocol

from urbihw.kernel.uobject import Motion
from urbihw.navigation.base import NavigationLog, ScannerWorker
from urbihw.navigation.lasers import fitting
from urbihw.navigation.lasers.device import LineLaser, Mount
from urbihw.navigation.navigator import Navigator
from urbihw.navigation.odometry import Odometry
from urbihw.navigation.pilot import Pilot, Wheels
from urbihw.platforms.p3dx.factors import Factors
from urbihw.platforms.p3dx.options import SIMULATED, P3dxOptions

SIMULATED_RANGE: Final = 32.0
"""m; the reading of MobileSim's laser without an echo."""


class P3dxCarriage(Wheels, Protocol):
    """The robot as the pilot sees it."""

    factors: Factors


class P3dxOdometry(Odometry):
    """``P3dx.body.odometry``"""

    slot_name = "P3dx.body.odometry"


class P3dxPilot(Pilot):
    """The pilot of the robot, whose size its subclass tells."""

    def __init__(self, robot: P3dxCarriage, odometry: Odometry, motion: Motion, log: NavigationLog) -> None:
        super().__init__(robot, odometry, motion, log)
        self._robot = robot

    @property
    def radius(self) -> float:
        """Distance in m from the middle to the farthest edge: the option, or that of the subclass."""
        return self._robot.navigation.radius or self._robot.factors.radius


class P3dxPlanner(Navigator):
    """``P3dx.planner``"""

    slot_name = "P3dx.planner"


class P3dxLaser(LineLaser):
    """``P3dx.body.laser``: on its own link, or MobileSim's, whose scans arrive with the robot's packets."""

    slot_name = "P3dx.body.laser"

    def init(  # type: ignore[override]
        self, mount: Mount, start_worker: Callable[..., ScannerWorker], watch: Callable[[bool], None], offset: float
    ) -> None:
        """The url may also be "sim"; ``watch`` switches the simulated laser; the rest as in ``LineLaser``."""
        super().init(mount, start_worker, offset)
        self._watch = watch

    def connect(self) -> None:
        """Switch MobileSim's laser on, or start the worker of a real one.  Raises ValueError without a laser."""
        if not self.mount.url:
            raise ValueError("this robot was given no laser; add ?laser=/dev/ttyUSB1 to its url")
        if self.mount.url == SIMULATED:
            self._watch(True)
        else:
            super().connect()

    def disconnect(self) -> None:
        """Switch MobileSim's laser off, or end the worker of a real one."""
        if self.mount.url == SIMULATED:
            self._watch(False)
        else:
            super().disconnect()

    def show_simulated_scan(self, millimetres: Sequence[int], stamp: float) -> None:
        """Show a scan of MobileSim's laser; the number of readings gives the angular step."""
        if self.wanted and len(millimetres) > 1:
            self.show_geometry(math.pi, math.pi / (len(millimetres) - 1))
            ranges = [value / 1000 if value < SIMULATED_RANGE * 1000 else math.inf for value in millimetres]
            self.show_scan(ranges, stamp, SIMULATED_RANGE)


def mount_of(options: P3dxOptions, factors: Factors, *, simulator: bool) -> Mount:
    """Return the laser of the options, or that of the simulator; its place is that of the subclass if none is given."""
    mount = fitting.mount_of(options)
    return replace(mount, url=mount.url or (SIMULATED if simulator else ""), place=mount.place or factors.laser_x)
