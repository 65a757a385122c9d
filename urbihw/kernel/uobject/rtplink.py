"""The RTP side of the link between a server and a remote: one at each end.

The remote chooses a secret and a port and tells the server, on its connection, by ``UObject.rtpOpen``; the server
answers with its own port.  From then on each end may send values of variables this way; whether it does is said per
variable (``use_rtp``).  Everything else stays on the connection, and so do the values if there is no RTP.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Protocol

from urbihw.kernel.uobject.frames import TooLong, Update
from urbihw.kernel.uobject.rtp import LARGE, SMALL, Receiver, Sender
from urbihw.kernel.uobject.udp import Packet, UdpPort, is_local

log = logging.getLogger("urbihw.uobject")


class Port(Protocol):
    """What carries packets (see ``udp``)."""

    port: int

    def send(self, packets: list[bytes], address: tuple[str, int]) -> bool:
        """Send packets; false if some were lost on the way out."""
        ...

    def close(self) -> None:
        """Let go of the socket."""
        ...


OpenPort = Callable[[str, Callable[[list[Packet]], None]], Port]


class RtpLink:
    """One end; ``post`` brings packets from the thread that reads them into the kernel's."""

    def __init__(
        self,
        peer: str,
        secret: bytes,
        post: Callable[[Callable[[], None]], None],
        updated: Callable[[Update], None],
        open_port: OpenPort = UdpPort,
    ) -> None:
        self._peer = peer
        self._address: tuple[str, int] | None = None
        self._sender = Sender(secret, LARGE if is_local(peer) else SMALL)
        self._receiver = Receiver(secret)
        self._post = post
        self._updated = updated
        self._port = open_port(peer, self._heard)

    @property
    def port(self) -> int:
        """The port of this end."""
        return self._port.port

    def to(self, port: int) -> None:
        """The port of the other end is known."""
        self._address = (self._peer, port)

    def send(self, update: Update, now: float) -> bool:
        """Send a value; false if it cannot go this way (not because it may get lost)."""
        if self._address is None:
            return False
        try:
            self._port.send(self._sender.packets(update, now), self._address)
        except (TooLong, TypeError):
            return False
        return True

    def _heard(self, packets: list[Packet]) -> None:
        self._post(lambda: self._take(packets))

    def _take(self, packets: list[Packet]) -> None:
        for packet, _ in packets:
            for update in self._receiver.feed(packet):
                self._updated(update)

    def close(self) -> None:
        """The connection is gone, and so is this."""
        self._address = None
        self._port.close()
