"""A UDP socket and the thread that reads it: what carries RTP."""

from __future__ import annotations

import ipaddress
import logging
import socket
import threading
from collections.abc import Callable

log = logging.getLogger("urbihw.uobject")

BUFFER = 4 << 20
"""Bytes that the system is asked to keep for us."""
BATCH = 64
"""Packets handed over at a time, at most."""

Packet = tuple[bytes, str]
"""A packet and the address it came from."""


def is_local(host: str) -> bool:
    """Whether an address is this machine's loopback."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class UdpPort:
    """Bound to any free port; ``heard(packets)`` is called from a thread of its own.

    Sending never waits: what the system does not take at once is lost.
    """

    def __init__(self, host: str, heard: Callable[[list[Packet]], None]) -> None:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        for option in (socket.SO_RCVBUF, socket.SO_SNDBUF):
            self._socket.setsockopt(socket.SOL_SOCKET, option, BUFFER)
        self._socket.bind((host if is_local(host) else "::" if family == socket.AF_INET6 else "", 0))
        self.port = int(self._socket.getsockname()[1])
        self._heard = heard
        self._closed = False
        self._thread = threading.Thread(target=self._read, name="urbihw-rtp", daemon=True)
        self._thread.start()

    def send(self, packets: list[bytes], address: tuple[str, int]) -> bool:
        """Send packets; false if the rest of them was lost on the way out."""
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
                packets: list[Packet] = []
                try:
                    packets.append(self._receive(0))
                    while len(packets) < BATCH:
                        packets.append(self._receive(socket.MSG_DONTWAIT))
                except BlockingIOError:
                    pass
                except OSError:
                    return
                if not self._closed:
                    self._heard(packets)

    def _receive(self, flags: int) -> Packet:
        data, address = self._socket.recvfrom(65536, flags)
        return data, str(address[0])

    def close(self) -> None:
        """Let go of the socket; the thread ends."""
        if self._closed:
            return
        self._closed = True
        here = "::1" if self._socket.family == socket.AF_INET6 else "127.0.0.1"
        if not self.send([b""], (here, self.port)):  # wakes the thread, which closes the socket
            self._socket.close()
