"""A cart that drives where it is told, without a wire and without inertia: a ``DrivenBase`` of the fewest lines."""

from __future__ import annotations

import logging
import math
import threading
from typing import Any

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UObject, function
from urbihw.navigation.base import DrivenBase, Scanner
from urbihw.navigation.drive import Drive, DriveMotion, State
from urbihw.navigation.frames import Point, Pose
from urbihw.navigation.navigator import Navigator
from urbihw.navigation.odometry import Odometry
from urbihw.navigation.options import NavigationOptions
from urbihw.robot import ROBOT_LIBRARY

STEP_S = 0.1


class CartOdometry(Odometry):
    """Its odometry."""


class CartPlanner(Navigator):
    """Its navigator."""

    slot_name = "cart.planner"


class Cart(UObject):
    """The cart.  ``near`` is what its bumpers see, ahead of and to the left of its middle."""

    log = logging.getLogger("cart")
    radius = 0.2
    scanner: Scanner | None = None

    def init(self) -> None:
        """It stands at the origin."""
        self.drive = Drive(self._ended)
        self.navigation = NavigationOptions()
        self.odometry = self.host.create(CartOdometry)
        self.motors = True
        self.near: list[Point] = []
        self.pose: Pose = (0.0, 0.0, 0.0)
        self.v = self.w = 0.0
        self.planner = self.host.create(CartPlanner, None, self)
        self.put_slot("planner", self.planner)
        self.put_slot("odometry", self.odometry)
        self.set_timer(STEP_S, self._step)

    @function("moveTo")
    def move_to(self, goal: Any) -> None:
        """As that of the Pioneer."""
        self.planner.move_to(goal)

    def check_motors(self) -> None:
        if not self.motors:
            raise ValueError("the motors are off")

    def claim_motion(self) -> None:
        """Do nothing: the cart obeys everybody."""

    def begin_motion(self, motion: DriveMotion) -> None:
        self.drive.start(motion)

    def obstacles(self) -> list[Point]:
        return self.near

    def _ended(self, motion: DriveMotion, how: str) -> None:
        self.planner.motion_ended(motion, how)

    def _step(self) -> None:
        x, y, heading = self.pose
        way, angle = self.v * STEP_S, self.w * STEP_S
        self.pose = (x + way * math.cos(heading), y + way * math.sin(heading), heading + angle)
        self.odometry.show_pose(*self.pose, way, angle, self.host.now())
        self.v, self.w = self.drive.step(State(self.host.now(), self.v, self.w))
        self.planner.pose_changed()


class Garage:
    """A kernel with a cart in it, in simulated time."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock(), libraries=(ROBOT_LIBRARY,))
        self.lobby = self.kernel.open_lobby()
        self.cart = self.kernel.host.create(Cart, "cart")
        base: DrivenBase = self.cart
        assert base.radius
        self.say(
            'at (cart.planner.pathPlanningEvent?(var how)) echo("path %s" % how);'
            'at (cart.planner.locFailureEvent?(var why)) echo("lost: " + why);'
        )

    def say(self, text: str, seconds: float = 0.0) -> list[str]:
        """What is answered to some statements within some seconds."""
        answer = self.kernel.run_text(self.lobby, text, self.kernel.scheduler.clock.now() + seconds)
        return [line.partition("] ")[2] for line in answer.splitlines()]

    def think(self) -> list[str]:
        """Wait for the threads of the navigator; what is said when the kernel has taken in what they found."""
        said: list[str] = []
        while threads := [thread for thread in threading.enumerate() if thread.name == "planner"]:
            for thread in threads:
                thread.join(20)
            # What has waited for the end of another piece of work begins here.
            said += self.say("")
        return said + self.say("", STEP_S)
