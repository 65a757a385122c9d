"""The settings of a bridge."""

from __future__ import annotations

from pathlib import Path

from urbihw.client.credentials import Credentials
from urbihw.client.where import Where
from urbihw.fleets.names import DEFAULT_ENDPOINT
from urbihw.frozen import frozen


@frozen(slots=False)
class FleetSettings:
    """What a bridge serves, and where.

    Attributes:
        fleet, name: the fleet, and the name of the robot in it.
        where, credentials: the daemon.
        control: the control socket of the bus worker.
        endpoint: where the fleet meets.
        platform: the name of the platform, "" if it is not known.
        hz: how often the values are published.
        drive: the names of those who may drive this robot from elsewhere.
        dead_man: seconds without a sign of life of a far client after which what it moves stops.
    """

    fleet: str
    name: str
    where: Where
    credentials: Credentials
    control: Path
    endpoint: str = DEFAULT_ENDPOINT
    platform: str = ""
    hz: float = 10.0
    drive: tuple[str, ...] = ()
    dead_man: float = 0.5
