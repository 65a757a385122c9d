"""One end of the RTP link between a server and a remote.

The remote chooses a secret, a port and a source number, and sends them to the server on its connection by
``UObject.rtpOpen``; the server answers with its own address, port and source number.  From then on each end may send
values of variables by RTP, depending on the variable (``use_rtp``).  All other messages use the connection, and so do
the values if RTP is not available.

A packet is accepted only if it comes from the address of the connection and the agreed port, with the secret and the
source number of the other end; all others are dropped and counted.
"""

from __future__ import annotations

import logging
import secrets
import threading
from collections.abc import Callable
from typing import Protocol

from urbihw.kernel.uremote.frames import StringTooLong, Update
from urbihw.kernel.uremote.rtp import LARGE_PIECE_SIZE, SMALL_PIECE_SIZE, RtpReceiver, Sender
from urbihw.kernel.uremote.udp import UdpPort, is_local

log = logging.getLogger("urbihw.uobject")

MAX_WAITING_SIZE = 8 << 20
"""Maximum number of packet bytes that wait for the kernel."""
PACKET_OVERHEAD = 2048
"""Number of bytes added to the size of each packet in that sum: the kernel has a fixed cost per packet."""


class PacketPort(Protocol):
    """The transport of packets (see ``udp``)."""

    address: str
    port: int
    strangers: int

    def to(self, port: int) -> None:
        """Set the port of the other end."""
        ...

    def send(self, packets: list[bytes]) -> bool:
        """Send packets; returns false if some could not be sent."""
        ...

    def close(self) -> None:
        """Close the socket of the port."""
        ...


OpenPort = Callable[[str, Callable[[list[bytes]], None], str], PacketPort]
"""Makes a transport, from the address of the other end, a callback for received packets, and a local address ("":
chosen by the system).
"""


class RtpLink:
    """One end of the link; ``post`` moves packets from the reading thread to the kernel's thread.

    Attributes:
        source: the source number in packets of this end.
        dropped: number of packets dropped because the kernel was busy.
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
        self._sender = Sender(secret, self.source, LARGE_PIECE_SIZE if is_local(peer) else SMALL_PIECE_SIZE)
        self._receiver: RtpReceiver | None = None
        self._post = post
        self._updated = updated
        self._lock = threading.Lock()
        self._waiting: list[bytes] = []
        self._cost = 0
        self._port = open_port(peer, self._queue_packets, local)

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
        """Number of packets from other addresses, or without the agreed secret and numbers."""
        return self._port.strangers + (0 if self._receiver is None else self._receiver.refused)

    def to(self, port: int, source: int) -> None:
        """Set the port and the source number of the other end."""
        self._receiver = RtpReceiver(self._secret, source)
        self._port.to(port)

    def send(self, update: Update, now: float) -> bool:
        """Send a value; returns false if it cannot be sent by RTP (a packet may still get lost)."""
        if self._receiver is None:
            return False
        try:
            self._port.send(self._sender.packets(update, now))
        except (StringTooLong, TypeError):
            return False
        return True

    def _queue_packets(self, packets: list[bytes]) -> None:
        """Queue received packets; called in the reading thread."""
        with self._lock:
            first = not self._waiting
            for packet in packets:
                self._cost += len(packet) + PACKET_OVERHEAD
                if self._cost > MAX_WAITING_SIZE:
                    self._cost -= len(packet) + PACKET_OVERHEAD
                    self.dropped += 1
                else:
                    self._waiting.append(packet)
            asked = first and self._waiting
        if asked:
            self._post(self._handle_packets)

    def _handle_packets(self) -> None:
        with self._lock:
            packets, self._waiting, self._cost = self._waiting, [], 0
        if self._receiver is None:
            return
        for packet in packets:
            for update in self._receiver.feed(packet):
                self._updated(update)

    def close(self) -> None:
        """Close this end because the connection has ended."""
        self._receiver = None
        self._port.close()
