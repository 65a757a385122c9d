"""Where services live: the end points that the ServiceDirectory tells, and the url to connect to.

NAOqi has most services in the process of the ServiceDirectory, which are called over the connection to it.  A service
of another process, such as a program on the robot, has end points of its own, one for each network of the robot.

User and password go to the end point that is connected to, and a directory can name any: so only addresses are taken,
in the one way in which they are written, and only those of the robot itself, unless the settings allow other hosts.
"""

from __future__ import annotations

import ipaddress
from typing import Any, Final

from urbihw.frozen import frozen
from urbihw_nao.qimessaging.checked import show_text, to_row, to_text, to_whole

_SCHEMES: Final = {"tcp": "qi", "tcps": "qis"}
"""Scheme of an end point -> that of our url."""
MOST_TRIED: Final = 2
"""End points of a service to which a connection is tried."""
MOST_READ: Final = 32
"""End points of a service that are looked at."""


@frozen(slots=False)
class ServicePlace:
    """Where a service is; the fields are those of a ServiceInfo."""

    name: str
    number: int
    machine: str
    process: int
    endpoints: tuple[str, ...]

    @classmethod
    def from_value(cls, value: Any) -> ServicePlace:
        """The place in an answer of the directory.  Raises BadFrame for another form."""
        name, number, machine, process, endpoints = to_row(value, 5)[:5]
        return cls(
            to_text(name), to_whole(number, 0, 0xFFFFFFFF), to_text(machine), to_whole(process, 0, 0xFFFFFFFF),
            tuple([to_text(each) for each in to_row(endpoints)[:MOST_READ]]),
        )  # fmt: skip

    def is_with(self, other: ServicePlace) -> bool:
        """Whether one connection reaches both: they are in one process, or share an end point."""
        if not self.endpoints or set(self.endpoints) & set(other.endpoints):
            return True
        return (self.machine, self.process) == (other.machine, other.process)

    def urls(self, robot: str, encrypted: bool, other_hosts: bool = False) -> list[str]:
        """The urls to try, best first, for somebody who has reached the directory at the address ``robot``.

        The password goes to each of them, so an encrypted connection leads to encrypted ones only.  The address of the
        robot comes first; loopback addresses are only those of the robot when the directory was reached by one; those
        of other hosts are tried with ``other_hosts`` only.
        """
        found = []
        for text in self.endpoints:
            scheme, _, address = text.partition("://")
            host, _, port = address.rpartition(":")
            where = to_address(host)
            if where is None or scheme != ("tcps" if encrypted else "tcp") or not _is_port(port):
                continue
            own = host == robot
            if own or (_is_loopback(robot) if where.is_loopback else other_hosts):
                found.append((not own, f"{_SCHEMES[scheme]}://{host}:{int(port)}"))
        return [url for _, url in sorted(found, key=lambda row: row[0])][:MOST_TRIED]

    def describe(self) -> str:
        """The end points, for a message."""
        return show_text(", ".join(self.endpoints), 200)


def to_address(host: str) -> ipaddress.IPv4Address | None:
    """The address of one host that is written as four decimal numbers; None for any other text."""
    try:
        found = ipaddress.IPv4Address(host)
    except ValueError:
        return None
    return None if found.is_unspecified or found.is_multicast or found.is_reserved else found


def _is_loopback(host: str) -> bool:
    found = to_address(host)
    return found is not None and found.is_loopback


def _is_port(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) <= 5 and 0 < int(text) < 65536
