"""The interfaces of a mobile base and of its range scanner for the navigator; SI units.

A platform implements ``Base`` on its robot: it owns a ``Drive``, asks it for the speeds after each measurement of the
pose, and orders these speeds.  The interfaces do not depend on the kind of base (Pioneer, Segway, NXT).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from urbihw.navigation.drive import Drive, DriveMotion
from urbihw.navigation.frames import Point, Pose
from urbihw.navigation.options import NavigationOptions

Echo = tuple[float, float]
"""Distance in m and angle in rad (to the left) from a scanner."""


class NavigationLog(Protocol):
    """Receives warnings: a logger of the standard library, or one that limits repetitions."""

    def warning(self, text: str, *values: Any) -> None:
        """Log a warning, formatted with ``%``."""
        ...


class ScannerWorker(Protocol):
    """The process or thread that owns the wire of a scanner."""

    def stop(self) -> None:
        """End it, and wait until it has ended."""
        ...


class PoseEstimate(Protocol):
    """The pose of the base on the map by its odometry; ``navigation.odometry.Odometry`` is one."""

    placed: Callable[[], None]
    """Called after a program has said where the base is; the navigator sets it."""

    @property
    def absolute(self) -> Pose:
        """The pose on the map."""
        ...

    def absolute_at(self, stamp: float) -> Pose:
        """The pose on the map at some time, s."""
        ...

    def correct(self, pose: Pose, stamp: float | None = None) -> None:
        """Set the pose of the base on the map at some time, s, or now."""
        ...


class Scanner(Protocol):
    """A laser or another range sensor; ``navigation.scanner.RangeScanner`` is one."""

    place: float
    """Distance in m from the middle of the base ahead to the scanner."""
    scanned: Callable[[], None]
    """Called after each scan; the navigator sets it."""
    stamp: float
    """Time of the last scan, s."""
    wanted: bool
    """A program has switched it on; it may be connecting, or lost."""

    def check_on(self) -> None:
        """Raises ValueError while the scanner is off; the message tells how to switch it on."""
        ...

    def echoes(self) -> Sequence[Echo]:
        """The readings of the last scan with an echo."""
        ...

    def fresh_echoes(self) -> Sequence[Echo]:
        """The readings of the last scan with an echo; none if the scan is older than a second."""
        ...

    def is_fresh(self) -> bool:
        """Whether the last scan is at most a second old."""
        ...


class DrivenBase(Protocol):
    """A base that the navigator can drive.

    It calls ``Navigator.pose_changed`` after each measurement of its pose, and ``Navigator.motion_ended`` when its
    ``Drive`` reports the end of a motion.
    """

    drive: Drive
    """The limits and the current motion; the base orders the speeds that the ``Drive`` computes."""

    @property
    def odometry(self) -> PoseEstimate:
        """The pose of the base on the map."""
        ...

    @property
    def scanner(self) -> Scanner | None:
        """The range scanner; None for a base without one."""
        ...

    @property
    def navigation(self) -> NavigationOptions:
        """The settings; they may change while the robot is open."""
        ...

    @property
    def radius(self) -> float:
        """Distance in m from the middle of the base to its farthest edge."""
        ...

    @property
    def log(self) -> NavigationLog:
        """The log of the robot."""
        ...

    def check_motors(self) -> None:
        """Raises ValueError while the base cannot drive; the message tells what to do."""
        ...

    def claim_motion(self) -> None:
        """Claim the base for motions of the running job.  Raises what ``kernel.uobject.Motion.admit`` raises."""
        ...

    def begin_motion(self, motion: DriveMotion) -> None:
        """Begin a motion of the job that called ``claim_motion`` last, and order its first speeds."""
        ...

    def obstacles(self) -> list[Point]:
        """Points that sensors other than the scanner detect now, in m ahead of and to the left of the middle of the
        base."""
        ...
