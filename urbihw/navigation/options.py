"""The options of navigation, which a platform adds to its ``[options]`` by inheritance."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Final

from urbihw import buses
from urbihw.buses.errors import BadUrl, Unavailable
from urbihw.buses.link import Context
from urbihw.frozen import frozen
from urbihw.settings import TEXT, Mistake, SettingsTable, choice, number, setting

ODOMETRY: Final = "odometry"
SCAN: Final = "scan"


@frozen(slots=False)
class NavigationOptions(SettingsTable):
    """The options of a base that has a navigator.

    Attributes:
        localization: "odometry", or "scan" to correct it by matching laser scans with the map.
        cell: size of the planner's grid cells, m.
        clearance: distance in m between planned paths and walls, in addition to the robot's radius.
        tolerance: distance in m from the goal within which a path has succeeded.
        heading_tolerance: the same for the heading, degrees.
        laser: url of the line of a laser, "" for none.
        laser_model: "lms200", "rplidar", "urg" (Hokuyo with SCIP 2) or "lms1xx" (SICK LMS1xx and TiM).
        laser_x: distance in m from the middle of the base ahead to the laser.
        laser_turn: degrees to the left from the front of the base to the front of the laser.
    """

    own_lasers: ClassVar[tuple[str, ...]] = ()
    """Values of ``laser`` that are no url: lasers on the wire of the robot."""

    localization: str = setting(ODOMETRY, choice(ODOMETRY, SCAN))
    cell: float = setting(0.1, number(0.02, 1.0, " m"))
    clearance: float = setting(0.05, number(0.0, 2.0, " m"))
    tolerance: float = setting(0.1, number(0.03, 2.0, " m"))
    heading_tolerance: float = setting(5.0, number(2.0, 180.0, " degrees"))
    laser: str = setting("", TEXT)
    laser_model: str = setting("lms200", choice("lms200", "rplidar", "urg", "lms1xx"), in_url=True)
    laser_x: float = setting(0.0, number(-2.0, 2.0, " m"))
    laser_turn: float = setting(0.0, number(-180.0, 180.0, " degrees"))


    def clashes(self) -> Iterator[Mistake]:
        """Yield a laser url that no bus accepts."""
        yield from super().clashes()
        if self.laser and self.laser not in self.own_lasers:
            try:
                buses.port_for(self.laser, Context())
            except (BadUrl, Unavailable) as error:
                yield Mistake("laser", str(error))


@frozen(slots=False)
class DrivenBaseOptions(NavigationOptions):
    """The options of a base that does not report its own size.

    Attributes:
        radius: distance in m from the middle between the wheels to the farthest edge of the robot.
    """

    radius: float = setting(0.4, number(0.02, 3.0, " m"))
