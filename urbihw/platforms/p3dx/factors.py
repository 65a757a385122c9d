"""Conversion factors, limits and sizes of the robots with ARCOS, by subclass.

Sources: ARIA's parameter files (``params/*.p``), Player's ``robot_params.cc``; ARIA has the angle factor with five
digits; it is a 4096th of a turn.  A subclass that ends in "-sh" has the SH2 controller (ARCOS), whose values are in mm
already; the others have the older H8.
"""

from __future__ import annotations

import math
from typing import Final

from urbihw.frozen import frozen
from urbihw.platforms.p3dx.sip import FULL_TURN

ANGLE: Final = 2 * math.pi / FULL_TURN
"""rad per count of a heading."""


@frozen
class Factors:
    """The factors of one subclass, raw counts to SI units.

    Attributes:
        distance: m per count of a position.
        speed: m/s per count of a wheel's speed.
        range: m per count of a sonar.
        half_track: m; rotation = (right - left) / 2 / half_track (so it is half the distance between the wheels).
        wheel_step: m/s per count of VEL2.
        fastest: m/s; fastest_turn: rad/s.
        length, width, radius: m.
        laser_x: m from the middle to the laser.
    """

    distance: float
    speed: float
    range: float
    half_track: float
    wheel_step: float
    fastest: float
    fastest_turn: float
    length: float
    width: float
    radius: float
    laser_x: float = 0.021


_COLUMNS = ("dist", "vel", "range", "diff", "vel2", "max_v", "max_w", "length", "width", "radius", "laser_x")
_TABLE: Final[dict[str, tuple[float, ...]]] = {
    # subclass: DistConv mm, VelConv mm/s, RangeConv mm, DiffConv, Vel2Divisor, mm/s, deg/s, mm, mm, mm, laser mm
    "p3dx": (0.485, 1.0, 1.0, 0.0056, 20, 2200, 500, 511, 425, 250, 18),
    "p3dx-sh": (1.0, 1.0, 1.0, 0.0056, 20, 2200, 500, 511, 425, 250, 21),
    "p2dx": (0.84, 1.0, 0.268, 0.0056, 20, 2200, 500, 511, 425, 250, 18),
    "p2de": (0.969, 1.0, 0.268, 0.0056, 20, 2200, 500, 511, 425, 250, 18),
    "p3at": (0.465, 1.0, 1.0, 0.0034, 20, 1200, 300, 626, 505, 500, 18),
    "p3at-sh": (1.0, 1.0, 1.0, 0.0034, 20, 1200, 300, 626, 505, 500, 18),
    "amigo": (0.5083, 0.6154, 1.0, 0.011, 20, 1000, 300, 330, 279, 180, 0),
    "amigo-sh": (1.0, 1.0, 1.0, 0.011, 20, 1000, 300, 330, 279, 180, 0),
}
DEFAULT: Final = "p3dx-sh"


def _factors(row: tuple[float, ...]) -> Factors:
    value = dict(zip(_COLUMNS, row, strict=True))
    return Factors(
        distance=value["dist"] / 1000,
        speed=value["vel"] / 1000,
        range=value["range"] / 1000,
        half_track=1 / value["diff"] / 1000,
        wheel_step=value["vel2"] / 1000,
        fastest=value["max_v"] / 1000,
        fastest_turn=math.radians(value["max_w"]),
        length=value["length"] / 1000,
        width=value["width"] / 1000,
        radius=value["radius"] / 1000,
        laser_x=value["laser_x"] / 1000,
    )


FACTORS: Final[dict[str, Factors]] = {name: _factors(row) for name, row in _TABLE.items()}
"""Subclass -> its factors."""


def factors_of(subclass: str) -> tuple[Factors, bool]:
    """Return the factors of a subclass, and whether it is known.

    "p3dx-sh-lms500" is a p3dx-sh with another laser.  An unknown one ("p3dx-new") gets the values of the newer
    controller, of its own kind of robot if that is known.
    """
    name, _, _ = subclass.lower().partition("-lms")
    if name in FACTORS:
        return FACTORS[name], True
    return FACTORS.get(f"{name.partition('-')[0]}-sh", FACTORS[DEFAULT]), False


@frozen
class SonarPlace:
    """Position and direction of a sonar: m and rad from the middle of the robot, x forward, y left."""

    x: float
    y: float
    heading: float


_RING: Final = ((69, 136, 90), (114, 119, 50), (148, 78, 30), (166, 27, 10),
                (166, -27, -10), (148, -78, -30), (114, -119, -50), (69, -136, -90),
                (-157, -136, -90), (-203, -119, -130), (-237, -78, -150), (-255, -27, -170),
                (-255, 27, 170), (-237, 78, 150), (-203, 119, 130), (-157, 136, 90))  # fmt: skip
SONARS: Final = tuple(SonarPlace(x / 1000, y / 1000, math.radians(heading)) for x, y, heading in _RING)
"""The ring of a Pioneer 3-DX (``params/p3dx.p``), by number."""
NO_ECHO: Final = 5.0
"""m; the reading of a sonar without an echo (observed; the ARCOS manual does not name it)."""
