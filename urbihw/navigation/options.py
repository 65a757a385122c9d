"""What the configuration may say about navigation: rows that a platform adds to its ``[options]`` by inheritance."""

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
        clearance: m that planned paths keep from walls, beside the robot's own radius.
    """

    localization: str = setting(ODOMETRY, choice(ODOMETRY, SCAN))
    cell: float = setting(0.1, number(0.02, 1.0, " m"))
    clearance: float = setting(0.05, number(0.0, 2.0, " m"))
