"""A complete simulated Pioneer: one body in one world, a controller on one line and a laser on another.

    kit = P3dx()
    kit.robot.feed(bytes.fromhex("FA FB 03 00 00 00"), 0.0)      # SYNC0

The two lines may be served by two threads: a lock guards the body they share.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from urbihw_fakes.lasers.cola import ColaLaser
from urbihw_fakes.lasers.rplidar import Rplidar
from urbihw_fakes.lasers.urg import Urg
from urbihw_fakes.p3dx.arcos import Arcos
from urbihw_fakes.p3dx.body import Body
from urbihw_fakes.p3dx.laser import SickLaser
from urbihw_fakes.p3dx.sips import Settings
from urbihw_fakes.p3dx.world import World

Laser = SickLaser | Rplidar | Urg | ColaLaser
LASERS: dict[str, Callable[[Body, threading.RLock], Laser]] = {
    "lms200": SickLaser,
    "rplidar": Rplidar,
    "urg": Urg,
    "lms1xx": ColaLaser,
}
"""The lasers that it can carry, by ``laser_model`` of the settings."""


class P3dx:
    """A robot in a world (the room of ``World.room`` if none is given), or a ``body`` that brings its world.

    Attributes:
        world, body: where it is and how it moves; robot, laser: the devices to serve.
    """

    def __init__(
        self,
        world: World | None = None,
        *,
        slip: float = 0.01,
        settings: Settings | None = None,
        laser: str = "lms200",
        body: Body | None = None,
    ) -> None:
        """``laser`` is a row of LASERS."""
        self.body = body if body is not None else Body(world if world is not None else World.room(), slip)
        self.world = self.body.world
        self.lock = threading.RLock()
        self.robot = Arcos(self.body, settings, self.lock)
        self.laser: Any = LASERS[laser](self.body, self.lock)
