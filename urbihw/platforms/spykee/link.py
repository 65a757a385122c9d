"""``spykee://``: the control connection of a robot, by its address or as the only one that answers.

    spykee://                    the one robot that answers on the network; several are named, and none is taken
    spykee://192.168.1.20        this one; a port other than 9000 is written behind a colon

Bytes that wait in this computer would make a stop late, so only few of them may wait (``is_writable``), and a robot
that acknowledges nothing any more is given up soon: its firmware goes on driving.
"""

from __future__ import annotations

import errno
import socket
from collections.abc import Mapping
from typing import Final

from urbihw.buses.errors import BadUrl, Unavailable
from urbihw.buses.link import Context, Url
from urbihw.buses.tcp import TcpLink
from urbihw.platforms.spykee import protocol as p
from urbihw.platforms.spykee.discovery import search
from urbihw.settings import SettingRule, whole

UNSENT_BYTES: Final = 4096
"""Bytes that may wait in this computer before ``is_writable`` says no."""
ACK_TIMEOUT_S: Final = 2.0
"""Seconds in which a robot must acknowledge what was sent."""
WIFI_BITS_PER_S: Final = 11_000_000
"""Bits per second of 802.11b, from which the statistics compute the load."""
KEEPALIVE_IDLE_S: Final = 2
"""Seconds of silence after which the system asks whether the robot is there; it asks every second, three times."""


class SpykeeLink(TcpLink):
    """A connection to the robot's control port; without an address, to the one that is found by discovery."""

    @classmethod
    def parameters(cls, url: Url) -> Mapping[str, SettingRule]:
        """Accept ``discovery``: the UDP port for the search for robots; tests use another one."""
        return {"discovery": whole(1, 65535)}

    def __init__(self, url: Url, context: Context) -> None:
        super().__init__(url, context)
        self.baud = WIFI_BITS_PER_S

    def _find_address(self, url: Url) -> tuple[str, int]:
        if not url.target:
            return "", 0
        host, colon, port = url.target.partition(":")
        if not host or (colon and not (port.isdigit() and 0 < int(port) < 65536)):
            raise BadUrl(f"bus url {url.text!r}: write spykee://host or spykee://host:port, or spykee:// alone")
        return host, int(port) if colon else p.PORT

    def _open(self) -> None:
        if not self.url.target:
            self._address = self._discover()
        super()._open()
        link = self._socket
        assert link is not None
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT_BYTES)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, round(ACK_TIMEOUT_S * 1000))
        link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, KEEPALIVE_IDLE_S)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)

    def _discover(self) -> tuple[str, int]:
        """The address of the only robot that answers.  Raises Unavailable."""
        try:
            robots = list(search(self.options.get("discovery", p.PORT)))
        except OSError as error:
            why = f"cannot look for a Spykee: {error.strerror}; is there a network?"
            raise Unavailable(error.errno or 0, why) from error
        if len(robots) != 1:
            raise Unavailable(errno.EHOSTUNREACH, _advice([f"{each}" for each in robots]))
        host, _, port = robots[0].address.partition(":")
        return host, int(port)


def _advice(robots: list[str]) -> str:
    if robots:
        return f"{len(robots)} Spykees answer: say which one by its url: {'; '.join(robots)}"
    return "no Spykee answers on any interface; is it switched on, and this computer in its network?"
