"""The pilot of a wheeled base: implements ``Base`` for the navigator on any platform with odometry.

A platform implements ``Wheels`` (order two speeds, report why the base cannot drive, report the limits).  With each
reading it reports the driven distance to its pilot (``show_way``), or that it is unknown (``stop_following``).  The
pilot keeps the odometry, asks the ``Drive`` for the next speeds, and orders them.

Ownership of motion: a path belongs to the statement that requested it.  Its orders carry the ``Origin`` of that
statement, so that a stop, the end of the connection or an emergency stop invalidates them, here and in the queue to the
worker.  Speeds that a program writes directly end the path (``yield_to_hand``).
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Final, Protocol

from urbihw.kernel.uobject import Motion as MotionAuthority
from urbihw.kernel.uobject import Origin
from urbihw.navigation.base import NavigationLog, Scanner
from urbihw.navigation.drive import STALL_TIMEOUT_S, Drive, DriveLimits, DriveMotion, State
from urbihw.navigation.frames import Point
from urbihw.navigation.navigator import Navigator
from urbihw.navigation.odometry import Odometry
from urbihw.navigation.options import DrivenBaseOptions

STANDING: Final = 0.01
STANDING_TURN: Final = 0.02
"""Speeds in m/s and rad/s below which a base with an order to move counts as blocked."""


class Wheels(Protocol):
    """The interface of the platform for the pilot."""

    @property
    def devices(self) -> tuple[Hashable, ...]:
        """The devices that move the base, by their names in the bus worker."""
        ...

    @property
    def navigation(self) -> DrivenBaseOptions:
        """The settings; they may change while the robot is open."""
        ...

    def order_speeds(self, v: float, w: float, origin: Origin) -> None:
        """Drive at these speeds (m/s ahead, rad/s to the left) from now on."""
        ...

    def check_motors(self) -> None:
        """Raises ValueError while the base cannot drive; the message tells what to do."""
        ...

    def update_limits(self, limits: DriveLimits) -> None:
        """Write the current limits of the base into ``limits``; the planner sets ``cruise`` and ``cruise_turn``."""
        ...

    def obstacles(self) -> list[Point]:
        """Points that the sensors of the platform detect, in m ahead of and to the left of the middle of the base."""
        ...


class Pilot:
    """Drives a wheeled base through its ``Wheels`` for the navigator, as a ``navigation.base.Base``.

    Attributes:
        drive: the limits and the current motion.
        log: the log of the robot.
        odometry: the pose of the base by its wheels.
        planner: its navigator, which the platform makes with this pilot as its base.
    """

    scanner: Scanner | None = None
    planner: Navigator

    def __init__(self, wheels: Wheels, odometry: Odometry, motion: MotionAuthority, log: NavigationLog) -> None:
        self.drive = Drive(self._motion_ended)
        self.odometry = odometry
        self.log = log
        self._wheels = wheels
        self._motion = motion
        self._origin = motion.own()
        self._ordered = (0.0, 0.0)
        self._read_at: float | None = None
        self._state = State(0.0, 0.0, 0.0)

    # ---------------------------------------------------------------- what the navigator asks

    @property
    def navigation(self) -> DrivenBaseOptions:
        """The settings; they may change while the robot is open."""
        return self._wheels.navigation

    @property
    def radius(self) -> float:
        """Distance in m from the middle between the wheels to the farthest edge, from the settings."""
        return self._wheels.navigation.radius

    def check_motors(self) -> None:
        """Raises ValueError while the base cannot drive; the message tells what to do."""
        self._wheels.check_motors()

    def claim_motion(self) -> None:
        """Claim the base for the running job: orders get its origin from now on.  Raises what ``Motion.admit``
        raises."""
        for device in self._wheels.devices:
            self._origin = self._motion.admit(device)

    def begin_motion(self, motion: DriveMotion) -> None:
        """Begin a motion of the job that called ``claim_motion`` last, within the current limits of the base."""
        self._wheels.update_limits(self.drive.limits)
        self.drive.start(motion)
        self._order_next()

    def obstacles(self) -> list[Point]:
        """Points that sensors detect now, in m ahead of and to the left of the middle of the base; [] without
        sensors."""
        return self._wheels.obstacles()

    # ---------------------------------------------------------------- what the platform tells

    def show_way(self, way: float, angle: float, stamp: float) -> None:
        """Process a reading: the base drove ``way`` m and turned by ``angle`` rad since the last one.  ``stamp`` is the
        kernel's time in s."""
        seconds = stamp - self._read_at if self._read_at is not None else 0.0
        self._read_at = stamp
        v, w = (way / seconds, angle / seconds) if seconds > 0 else (self._state.v, self._state.w)
        blocked = self._ordered != (0.0, 0.0) and abs(v) < STANDING and abs(w) < STANDING_TURN
        self.odometry.add_way(way, angle, stamp)
        self.show_state(State(stamp, v, w, stalled=blocked))

    def show_state(self, state: State) -> None:
        """Process a reading of a base that measures its speeds and keeps ``odometry`` up to date itself."""
        self._state = state
        self._order_next()
        self.planner.pose_changed()

    def stop_following(self, reason: str) -> None:
        """End the path, if there is one, and stop the base because of ``reason``."""
        self.planner.cancel()
        self.drive.halt(reason)
        if self._ordered != (0.0, 0.0):
            self._order(0.0, 0.0, self._motion.own())

    def set_speeds(self, v: float | None, w: float | None) -> None:
        """Drive at fixed speeds (m/s, rad/s; None keeps one), within the safety distances; this ends a path.

        Raises what ``Motion.admit`` raises.
        """
        self.claim_motion()
        self._wheels.update_limits(self.drive.limits)
        self.planner.cancel()
        self.drive.set(v, w)
        self._order_next()

    def yield_to_hand(self) -> None:
        """End the path because a program is about to write a speed; the other speed becomes 0 instead of the one of the
        path."""
        self.stop_following("a speed was written")

    def drop_orders(self, reason: str) -> None:
        """End the path without further orders: the worker has stopped the base, or the link is down."""
        self._ordered = (0.0, 0.0)
        self.stop_following(reason)

    def change_wheels(self, wheels: Wheels) -> None:
        """Replace the wheels; a path with the old ones is ended."""
        self.stop_following("the wheels were changed")
        self._wheels = wheels

    # ---------------------------------------------------------------- orders

    def _order_next(self) -> None:
        """Order the next speeds of the motion, or the fixed ones, if there are any."""
        if self.drive.motion is None and not self.drive.is_driving and self._ordered == (0.0, 0.0):
            return
        if not all(self._motion.is_live(self._origin, device) for device in self._wheels.devices):
            self.stop_following(self._motion.reason)
            return
        had_motion, was_driving = self.drive.motion is not None, self.drive.is_driving
        v, w = self.drive.step(self._state)
        if was_driving and not self.drive.is_driving:
            self.log.warning("the wheels have been blocked for %g s: the base is stopped", STALL_TIMEOUT_S)
        if self.drive.motion is not None or not had_motion:
            self._order(v, w, self._origin)

    def _order(self, v: float, w: float, origin: Origin) -> None:
        self._ordered = (v, w)
        self._wheels.order_speeds(v, w, origin)

    def _motion_ended(self, motion: DriveMotion, how: str) -> None:
        if self._ordered != (0.0, 0.0):
            self._order(0.0, 0.0, self._motion.own())
        self.planner.motion_ended(motion, how)
