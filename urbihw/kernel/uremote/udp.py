"""A UDP socket and the thread that reads it: the transport of RTP."""

from __future__ import annotations

import ipaddress
import logging
import socket
import threading
from collections.abc import Callable
from typing import Any

log = logging.getLogger("urbihw.uobject")

RECEIVE_BUFFER_SIZE = 4 << 20
"""Requested size of the socket's receive buffer in bytes."""
MAX_BATCH_SIZE = 64
"""Maximum number of packets handed over in one call."""


def is_local(host: str) -> bool:
    """Whether an address is a loopback address."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def is_same(one: str, other: str) -> bool:
    """Whether two numeric addresses are equal, ignoring the interface."""
    return _plain(one) == _plain(other)


class UdpPort:
    """A UDP socket for one peer; ``heard(packets)`` is called from a thread of its own.

    It is bound to a free port of ``local``, or of the address from which the system reaches ``peer``; both are numeric.
    Packets from other addresses than ``peer``, or from another port than that of ``to``, are counted as ``strangers``
    and dropped.  Sending never blocks: a packet that the system does not accept at once is lost.  Raises OSError.
    """

    def __init__(self, peer: str, heard: Callable[[list[bytes]], None], local: str = "") -> None:
        self._peer = _resolved(peer, 9)
        self._from: tuple[str, int] | None = None
        family = socket.AF_INET6 if len(self._peer) > 2 else socket.AF_INET
        here = _resolved(local, 0) if local else (_way_to(family, self._peer), 0, *self._peer[2:])
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            for option in (socket.SO_RCVBUF, socket.SO_SNDBUF):
                self._socket.setsockopt(socket.SOL_SOCKET, option, RECEIVE_BUFFER_SIZE)
            self._socket.bind(here)
        except OSError:
            self._socket.close()
            raise
        self._here = self._socket.getsockname()
        self.address = _plain(self._here[0])
        self.port = int(self._here[1])
        self.strangers = 0
        self._heard = heard
        self._closed = False
        self._thread = threading.Thread(target=self._read, name="urbihw-rtp", daemon=True)
        self._thread.start()

    def to(self, port: int) -> None:
        """Set the port of the peer: packets are sent to it and accepted from it."""
        self._peer = (self._peer[0], port, *self._peer[2:])
        self._from = _plain(self._peer[0]), port

    def send(self, packets: list[bytes]) -> bool:
        """Send packets; returns false if the rest of them could not be sent."""
        return self._send(packets, self._peer)

    def _send(self, packets: list[bytes], address: Any) -> bool:
        try:
            for packet in packets:
                self._socket.sendto(packet, socket.MSG_DONTWAIT, address)
        except OSError as error:
            log.debug("RTP packet not sent: %s", error)
            return False
        return True

    def _read(self) -> None:
        with self._socket:
            while not self._closed:
                packets: list[bytes] = []
                try:
                    self._receive(packets, 0)
                    for _ in range(MAX_BATCH_SIZE):
                        self._receive(packets, socket.MSG_DONTWAIT)
                except BlockingIOError:
                    pass
                except OSError:
                    return
                if packets and not self._closed:
                    self._heard(packets)

    def _receive(self, packets: list[bytes], flags: int) -> None:
        data, address = self._socket.recvfrom(65536, flags)
        if (_plain(address[0]), address[1]) == self._from:
            packets.append(data)
        elif not self._closed:
            self.strangers += 1

    def close(self) -> None:
        """Close the socket; the thread ends."""
        if self._closed:
            return
        self._closed = True
        if not self._send([b""], self._here):  # wakes the thread, which closes the socket
            self._socket.close()


def _resolved(host: str, port: int) -> Any:
    """The socket address for a numeric host."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM, flags=socket.AI_NUMERICHOST)
    return found[0][4]


def _way_to(family: int, peer: Any) -> str:
    """The local address from which the system reaches a peer; no packet is sent."""
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect(peer)
        return str(probe.getsockname()[0])


def _plain(host: str) -> str:
    """An address without its interface."""
    return host.partition("%")[0]
