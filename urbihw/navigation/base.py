"""What the navigator needs of a mobile base and of its range scanner; SI units.

A platform implements ``Base`` on its robot: it owns a ``Drive``, asks that how fast to go whenever its pose was
measured, and orders these speeds.  Whether the wheels are those of a Pioneer, a Segway or an NXT is not known here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from urbihw.navigation.drive import Drive, Motion
from urbihw.navigation.frames import Point, Pose
from urbihw.navigation.options import NavigationOptions

Echo = tuple[float, float]
"""Distance in m and angle in rad (to the left) from a scanner."""


class Log(Protocol):
    """Where warnings go: a logger of the standard library, or one that thins out repetitions."""

    def warning(self, text: str, *values: Any) -> None:
        """Log a line, formatted with ``%``."""
        ...


class Worker(Protocol):
    """The process or thread that owns the wire of a scanner."""

    def stop(self) -> None:
        """End it, and wait until it has ended."""
        ...


class PoseEstimate(Protocol):
    """Where the base is on the map, as its odometry says; ``navigation.odometry.Odometry`` is one."""

    @property
    def absolute(self) -> Pose:
        """The pose on the map."""
        ...

    def correct(self, pose: Pose) -> None:
        """The base is at this pose of the map."""
        ...


class Scanner(Protocol):
    """A laser, or what else measures ranges; ``navigation.scanner.RangeScanner`` is one."""

    place: float
    """m from the middle of the base to the scanner, ahead."""
    scanned: Callable[[], None]
    """Called after each scan; the navigator sets it."""

    def check_on(self) -> None:
        """Raises ValueError, saying how to switch it on, while it is off."""
        ...

    def echoes(self) -> Sequence[Echo]:
        """The readings of the last scan that hit something."""
        ...

    def fresh_echoes(self) -> Sequence[Echo]:
        """The same; none when the scan is older than a second."""
        ...


class Base(Protocol):
    """A base that drives where the navigator wants it to.

    When its pose was measured it calls ``Navigator.pose_changed``, and when its ``Drive`` reports the end of a motion,
    ``Navigator.motion_ended``.
    """

    drive: Drive
    """Its limits, and the motion that is under way; the base orders the speeds that it decides on."""

    @property
    def odometry(self) -> PoseEstimate:
        """Where it is."""
        ...

    @property
    def scanner(self) -> Scanner | None:
        """What measures ranges, None for a base without such a thing."""
        ...

    @property
    def navigation(self) -> NavigationOptions:
        """The settings; they may change while the robot is open."""
        ...

    @property
    def radius(self) -> float:
        """m from its middle to its farthest edge."""
        ...

    @property
    def log(self) -> Log:
        """The log of the robot."""
        ...

    def check_motors(self) -> None:
        """Raises ValueError, saying what to do, while the base cannot drive."""
        ...

    def claim_motion(self) -> None:
        """The running job will move the base; raises as ``kernel.uobject.Motion.admit`` does."""
        ...

    def begin_motion(self, motion: Motion) -> None:
        """Begin a motion of the job that called ``claim_motion`` last, and order its first speeds."""
        ...

    def obstacles(self) -> list[Point]:
        """What sensors other than the scanner see now, ahead of and to the left of the middle of the base."""
        ...
