"""What the configuration may say of a Pioneer: ``[options]`` in ``urbihw.toml``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, Self

from urbihw.buses.errors import BadValue
from urbihw.platforms.p3dx.factors import FACTORS

HOST_BAUDS: Final = {9600: 0, 19200: 1, 38400: 2, 57600: 3, 115200: 4}
"""Speed of the line -> argument of HOSTBAUD."""
ODOMETRY, SCAN = "odometry", "scan"


@dataclass(frozen=True, slots=True)
class Options:
    """All options and their defaults.

    Attributes:
        subclass: whose conversion factors to use (see ``factors``), "" for what the robot says.
        laser: url of the laser's line, "sim" for the one of MobileSim, "" for what the robot's url says (``?laser=``).
        host_baud: ask the controller for this speed after connecting (0: stay); only with a firmware that allows it.
        localization: "odometry", or "scan" to correct it by matching laser scans with the map.
        cell: size of the planner's grid cells, m.
        clearance: m that planned paths keep from walls, beside the robot's own radius.
    """

    subclass: str = ""
    laser: str = ""
    host_baud: int = 0
    localization: str = ODOMETRY
    cell: float = 0.1
    clearance: float = 0.05

    @classmethod
    def read(cls, table: Mapping[str, Any]) -> Self:
        """Check the options of a configuration.  Raises BadValue, naming the option and what is wanted."""
        known = {field.name for field in fields(cls)}
        for name in table:
            if name not in known:
                raise BadValue(f"there is no option {name!r}; there are: {', '.join(sorted(known))}")
        made = cls(**table)
        if made.subclass not in ("", *FACTORS):
            raise BadValue(f"subclass must be one of {', '.join(FACTORS)}, not {made.subclass!r}")
        if not isinstance(made.laser, str):
            raise BadValue(f"laser must be a url in quotes, not {made.laser!r}")
        if made.host_baud not in (0, *HOST_BAUDS):
            raise BadValue(f"host_baud must be one of 0, {', '.join(map(str, HOST_BAUDS))}, not {made.host_baud!r}")
        if made.localization not in (ODOMETRY, SCAN):
            raise BadValue(f'localization must be "odometry" or "scan", not {made.localization!r}')
        for name, least, most in (("cell", 0.02, 1.0), ("clearance", 0.0, 2.0)):
            value = getattr(made, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
                raise BadValue(f"{name} must be from {least:g} to {most:g} m, not {value!r}")
        return made
