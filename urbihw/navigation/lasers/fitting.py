"""The laser that the settings of a base name, for platforms without a laser of their own."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from urbihw.kernel.uobject import Host
from urbihw.navigation.base import NavigationLog, ScannerWorker
from urbihw.navigation.lasers.device import LineLaser, Mount
from urbihw.navigation.options import NavigationOptions


class BaseLaser(LineLaser):
    """``robot.body.laser`` of a base whose settings name one."""

    slot_name = "robot.body.laser"


class PartReport(Protocol):
    """Where the robot reports its problems."""

    def show_part(self, name: str, reason: str) -> None:
        """Tell that a part on a wire of its own is lost, or ("") is there."""
        ...


class Fitted(Protocol):
    """The robot as this module sees it."""

    @property
    def start_worker(self) -> Callable[..., ScannerWorker]:
        """The function that starts the worker of the laser."""
        ...

    @property
    def offset(self) -> float:
        """Kernel's time = worker's time + offset, in seconds."""
        ...

    @property
    def host(self) -> Host:
        """The kernel as the laser sees it."""
        ...

    @property
    def log(self) -> NavigationLog:
        """The log of the robot."""
        ...

    @property
    def report(self) -> PartReport:
        """The problems of the robot."""
        ...

    def put_slot(self, name: str, value: Any) -> None:
        """Give the robot a slot."""
        ...


def mount_of(options: NavigationOptions) -> Mount:
    """Return the laser of the settings."""
    return Mount(options.laser, options.laser_model, options.laser_x, math.radians(options.laser_turn))


def fit_laser(robot: Fitted, options: NavigationOptions) -> BaseLaser | None:
    """Make the laser of the settings, and the slot ``laser`` of the robot; None if they name none."""
    if not options.laser:
        return None
    laser = robot.host.create(BaseLaser, None, mount_of(options), robot.start_worker, robot.offset)
    laser.log = robot.log
    laser.tell_lost = partial(robot.report.show_part, "laser")
    robot.put_slot("laser", laser)
    return laser
