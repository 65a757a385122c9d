"""The RTP side of the link between a server and a remote: one at each end.

The remote chooses a secret, a port and the number of its source, and tells the server, on its connection, by
``UObject.rtpOpen``; the server answers with its own address, port and number.  From then on each end may send values of
variables this way; whether it does is said per variable (``use_rtp``).  Everything else stays on the connection, and so
do the values if there is no RTP.

Packets count only from the address of the connection and the port that was agreed, with the secret and the number of
the other end; all others are dropped and counted.
"""

from __future__ import annotations

import logging
import secrets
import threading
from collections.abc import Callable
from typing import Protocol

from urbihw.kernel.uremote.frames import TooLong, Update
from urbihw.kernel.uremote.rtp import LARGE, SMALL, Receiver, Sender
from urbihw.kernel.uremote.udp import UdpPort, is_local

log = logging.getLogger("urbihw.uobject")

MOST_WAITING = 8 << 20
"""How many bytes of packets may wait for the kernel."""
COST = 2048
"""What a packet counts for beside its bytes: however small it is, the kernel has to look at it."""


class Port(Protocol):
    """What carries packets (see ``udp``)."""

    address: str
    port: int
    strangers: int

    def to(self, port: int) -> None:
        """The port of the other end is known."""
        ...

    def send(self, packets: list[bytes]) -> bool:
        """Send packets; false if some were lost on the way out."""
        ...

    def close(self) -> None:
        """Let go of the socket."""
        ...


OpenPort = Callable[[str, Callable[[list[bytes]], None], str], Port]
"""Makes a port that talks to an address, tells of packets, and is bound to an address ("": as the system thinks)."""


class RtpLink:
    """One end; ``post`` brings packets from the thread that reads them into the kernel's.

    Attributes:
        source: the number that packets of this end carry.
        dropped: how many packets there were that the kernel was too busy for.
    """

    def __init__(
        self,
        peer: str,
        secret: bytes,
        post: Callable[[Callable[[], None]], None],
        updated: Callable[[Update], None],
        open_port: OpenPort = UdpPort,
        local: str = "",
    ) -> None:
        self.peer = peer
        self.source = secrets.randbits(32)
        self.dropped = 0
        self._secret = secret
        self._sender = Sender(secret, self.source, LARGE if is_local(peer) else SMALL)
        self._receiver: Receiver | None = None
        self._post = post
        self._updated = updated
        self._lock = threading.Lock()
        self._waiting: list[bytes] = []
        self._cost = 0
        self._port = open_port(peer, self._heard, local)

    @property
    def address(self) -> str:
        """The address to which this end is bound."""
        return self._port.address

    @property
    def port(self) -> int:
        """The port of this end."""
        return self._port.port

    @property
    def refused(self) -> int:
        """How many packets there were from elsewhere, or without what was agreed."""
        return self._port.strangers + (0 if self._receiver is None else self._receiver.refused)

    def to(self, port: int, source: int) -> None:
        """The port of the other end and the number of its source are known."""
        self._receiver = Receiver(self._secret, source)
        self._port.to(port)

    def send(self, update: Update, now: float) -> bool:
        """Send a value; false if it cannot go this way (not because it may get lost)."""
        if self._receiver is None:
            return False
        try:
            self._port.send(self._sender.packets(update, now))
        except (TooLong, TypeError):
            return False
        return True

    def _heard(self, packets: list[bytes]) -> None:
        """In the thread that reads: packets are there."""
        with self._lock:
            first = not self._waiting
            for packet in packets:
                self._cost += len(packet) + COST
                if self._cost > MOST_WAITING:
                    self._cost -= len(packet) + COST
                    self.dropped += 1
                else:
                    self._waiting.append(packet)
            asked = first and self._waiting
        if asked:
            self._post(self._take)

    def _take(self) -> None:
        with self._lock:
            packets, self._waiting, self._cost = self._waiting, [], 0
        if self._receiver is None:
            return
        for packet in packets:
            for update in self._receiver.feed(packet):
                self._updated(update)

    def close(self) -> None:
        """The connection is gone, and so is this."""
        self._receiver = None
        self._port.close()
