"""Where services live: the end points that the ServiceDirectory tells, and the url to connect to.

NAOqi has most services in the process of the ServiceDirectory, which are called over the connection to it.  A service
of another process, such as a program on the robot, has end points of its own, one for each network of the robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

_SCHEMES: Final = {"tcp": "qi", "tcps": "qis"}
"""Scheme of an end point -> that of our url."""
MOST_TRIED: Final = 2
"""End points of a service to which a connection is tried."""


@dataclass(frozen=True)
class Place:
    """Where a service is; the fields are those of a ServiceInfo."""

    name: str
    number: int
    machine: str
    process: int
    endpoints: tuple[str, ...]

    @classmethod
    def from_value(cls, value: Any) -> Place:
        """The place in an answer of the directory.  Raises ValueError, TypeError or IndexError for another form."""
        name, number, machine, process, endpoints = value[:5]
        return cls(str(name), int(number), str(machine), int(process), tuple(map(str, endpoints)))

    def is_with(self, other: Place) -> bool:
        """Whether one connection reaches both: they are in one process, or share an end point."""
        if not self.endpoints or set(self.endpoints) & set(other.endpoints):
            return True
        return (self.machine, self.process) == (other.machine, other.process)

    def urls(self, target: str, encrypted: bool) -> list[str]:
        """The urls to try, best first, for somebody who has reached the directory at ``target`` (host, or host:port).

        The password goes to each of them, so an encrypted connection leads to encrypted ones only.  The address of the
        directory comes first; loopback addresses are only those of the robot when the directory was reached by one.
        """
        host = target.partition(":")[0]
        found = []
        for text in self.endpoints:
            scheme, separator, address = text.partition("://")
            own, colon, port = address.partition(":")
            usable = separator and colon and port.isdigit() and scheme == ("tcps" if encrypted else "tcp")
            if usable and (not _is_loopback(own) or _is_loopback(host)):
                found.append((own != host, f"{_SCHEMES[scheme]}://{address}"))
        return [url for _, url in sorted(found, key=lambda row: row[0])][:MOST_TRIED]


def _is_loopback(host: str) -> bool:
    return host == "localhost" or host.startswith("127.")
