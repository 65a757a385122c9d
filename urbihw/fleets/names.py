"""Names of fleets and robots, where a fleet meets, and the keys of zenoh that are made of them.  No I/O.

::

    school/bob/robot/7f3a      liveliness: the robot bob is there, by this bridge
    school/bob/client/91c2     liveliness: somebody is there who calls himself bob
    school/bob/info            query: platform, version, slots with units
    school/bob/values          put: all values of a tick, {"n": 7, "t": 1790000000.1, "v": {"motor6.val": 0.52}}
    school/bob/state           put: link, emergency stop, battery, verdict, who drives
    school/bob/event/stopped   put: {"t": 1790000000.1, "args": [...]}
    school/bob/motor6/val      query: one value, {"t": ..., "age": 0.04, "value": 0.52, "who": "teacher (fleet)"}
    school/bob/from/anna/stop  query: an order of anna to bob; "*" for bob is an order to all

The name of the one who asks is a part of the key, so that a router can hold rights by the name of a certificate.
"""

from __future__ import annotations

import ipaddress
import re
from typing import Final, NamedTuple

from urbihw.client.where import is_loopback

MAX_NAME_LENGTH: Final = 40
NAME_PATTERN: Final = rf"[a-z][a-z0-9-]{{0,{MAX_NAME_LENGTH - 1}}}"
_NAME: Final = re.compile(NAME_PATTERN)
_STRAY: Final = re.compile(r"[^a-z0-9]+")
ALL: Final = "*"
"""Stands for each robot, or each fleet, in a key."""
FROM: Final = "from"
DEFAULT_ENDPOINT: Final = "tcp/127.0.0.1:7447"
"""Where the fleet meets: a router of zenoh.  On this machine alone, unless the settings say otherwise."""


class BadFleetName(ValueError):
    """A name that no fleet and no robot can have; the message is one line."""


def checked_fleet_name(text: str) -> str:
    """A name of a fleet or a robot.  Raises BadFleetName."""
    if not _NAME.fullmatch(text):
        raise BadFleetName(
            f"{text[:60]!r} is no name in a fleet: a small letter, then small letters, digits and -, "
            f"at most {MAX_NAME_LENGTH}"
        )
    return text


def fleet_name_of(text: str) -> str:
    """The nearest name to any text, such as the name of a host; "robot" if nothing is left of it."""
    found = _STRAY.sub("-", text.lower()).strip("-0123456789")[:MAX_NAME_LENGTH].strip("-")
    return found or "robot"


class FleetOrder(NamedTuple):
    """What a query asks a robot for: ``who`` asks, "" for a value; ``verb``, or the path of a slot."""

    who: str
    verb: str


class FleetKeys:
    """The keys of one name in a fleet: ``FleetKeys("school", "bob")``."""

    def __init__(self, fleet: str, name: str) -> None:
        self.fleet = fleet
        self.name = name
        own = f"{fleet}/{name}"
        self.everything = f"{own}/**"
        self.info = f"{own}/info"
        self.values = f"{own}/values"
        self.state = f"{own}/state"
        self.events = f"{own}/event/*"
        self.robots = f"{own}/robot/*"
        self.clients = f"{own}/client/*"
        self.beats = f"{own}/{FROM}/*/beat"

    def robot(self, instance: str) -> str:
        """The token of a bridge."""
        return f"{self.fleet}/{self.name}/robot/{instance}"

    def client(self, instance: str) -> str:
        """The token of one who asks."""
        return f"{self.fleet}/{self.name}/client/{instance}"

    def event(self, name: str) -> str:
        """The key of an event of the robot."""
        return f"{self.fleet}/{self.name}/event/{name}"

    def slot(self, path: str) -> str:
        """The key of a slot by its path, such as ``motor6.val``."""
        return f"{self.fleet}/{self.name}/{path.replace('.', '/')}"

    def order(self, robot: str, verb: str) -> str:
        """The key of an order of this name to a robot, or to ``ALL``."""
        return f"{self.fleet}/{robot}/{FROM}/{self.name}/{verb}"

    def order_in(self, key: str) -> FleetOrder | None:
        """What a key asks this robot for; None for what no robot answers, such as a question with wildcards."""
        fleet, _, rest = key.partition("/")
        name, _, asked = rest.partition("/")
        chunks = asked.split("/")
        if fleet not in (self.fleet, ALL) or name not in (self.name, ALL) or "*" in asked or "" in chunks:
            return None
        if chunks[0] == FROM:
            return FleetOrder(chunks[1], chunks[2]) if len(chunks) == 3 and _NAME.fullmatch(chunks[1]) else None
        return FleetOrder("", asked if len(chunks) == 1 else ".".join(chunks))

    def answer_to(self, order: FleetOrder) -> str:
        """The key on which an order is answered."""
        if order.who:
            return f"{self.fleet}/{self.name}/{FROM}/{order.who}/{order.verb}"
        return self.slot(order.verb)


def owner_in(key: str) -> tuple[str, str, str]:
    """Fleet, name and last part of a key."""
    fleet, _, rest = key.partition("/")
    name, _, rest = rest.partition("/")
    return fleet, name, rest.rpartition("/")[2]


def is_stop(path: str) -> bool:
    """Whether a function stops its robot."""
    return path.rpartition(".")[2] == "stop"


class BadEndpoint(ValueError):
    """An endpoint at which no fleet can meet; the message is one line."""


def checked_endpoint(text: str) -> str:
    """An endpoint of this machine alone, such as ``tcp/127.0.0.1:7447``.  Raises BadEndpoint.

    Nothing goes in clear off this machine: without TLS names prove nothing, and anybody in the network could drive.
    """
    scheme, _, place = text.partition("/")
    host, _, port = place.rpartition(":")
    if scheme != "tcp" or not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise BadEndpoint(f"{text[:60]!r} is no endpoint: give one such as {DEFAULT_ENDPOINT}")
    if not is_own_machine(text):
        raise BadEndpoint(f"{text[:60]}: a fleet is on one machine alone, since nothing is encrypted; lead the port "
                          "there by a tunnel (ssh -L 7447:127.0.0.1:7447)")
    return text


def is_own_machine(endpoint: str) -> bool:
    """Whether an endpoint is of this machine alone."""
    host = endpoint.partition("/")[2].rpartition(":")[0].strip("[]")
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return is_loopback(host)
