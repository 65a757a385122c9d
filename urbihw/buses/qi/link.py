"""``qi://``: the connection to NAOqi on a robot, by its address; the port is 9559 where none is written.

Bytes that wait in this computer would make a stop late, and a robot that acknowledges nothing any more must be given up
soon, for what it was told to do it goes on doing.
"""

from __future__ import annotations

import socket
from collections.abc import Mapping
from typing import Final

from urbihw.buses.errors import BadUrl
from urbihw.buses.link import Context, Url
from urbihw.buses.tcp import TcpLink
from urbihw.settings import Rule

PORT: Final = 9559
LINE_BITS: Final = 54_000_000
"""Bits per second of a network that a Nao may be in (802.11g), for the load that is shown."""
LOST_S: Final = 2.0
"""Seconds in which a robot must acknowledge what was sent."""


class QiLink(TcpLink):
    """A connection to a server of QiMessaging."""

    def __init__(self, url: Url, context: Context) -> None:
        super().__init__(url, context)
        self.baud = LINE_BITS

    @classmethod
    def parameters(cls, url: Url) -> Mapping[str, Rule]:
        """See `Port`: there are none."""
        return {}

    def _find_address(self, url: Url) -> tuple[str, int]:
        host, colon, port = url.target.partition(":")
        if not host or (colon and not (port.isdigit() and 0 < int(port) < 65536)):
            raise BadUrl(f"bus url {url.text!r}: write qi://host or qi://host:port")
        return host, int(port) if colon else PORT

    def _open(self) -> None:
        super()._open()
        assert self._socket is not None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, round(LOST_S * 1000))
