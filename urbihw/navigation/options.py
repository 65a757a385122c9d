"""The options of navigation, which a platform adds to its ``[options]`` by inheritance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from urbihw.settings import Table, choice, number, setting

ODOMETRY: Final = "odometry"
SCAN: Final = "scan"


@dataclass(frozen=True)
class NavigationOptions(Table):
    """The options of a base that has a navigator.

    Attributes:
        localization: "odometry", or "scan" to correct it by matching laser scans with the map.
        cell: size of the planner's grid cells, m.
        clearance: distance in m between planned paths and walls, in addition to the robot's radius.
        tolerance: distance in m from the goal within which a path has succeeded.
        heading_tolerance: the same for the heading, degrees.
    """

    localization: str = setting(ODOMETRY, choice(ODOMETRY, SCAN))
    cell: float = setting(0.1, number(0.02, 1.0, " m"))
    clearance: float = setting(0.05, number(0.0, 2.0, " m"))
    tolerance: float = setting(0.1, number(0.03, 2.0, " m"))
    heading_tolerance: float = setting(5.0, number(2.0, 180.0, " degrees"))


@dataclass(frozen=True)
class DrivenBaseOptions(NavigationOptions):
    """The options of a base that does not report its own size.

    Attributes:
        radius: distance in m from the middle between the wheels to the farthest edge of the robot.
    """

    radius: float = setting(0.4, number(0.02, 3.0, " m"))
