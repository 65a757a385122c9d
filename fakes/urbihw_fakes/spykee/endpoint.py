"""A Spykee on the network: its control port (TCP) and its answers to who looks for it (UDP), of the same number.

One user has it; who else connects and logs in is refused.  Several on one machine have loopback addresses of their own
(127.0.0.2 ...) and the same port.
"""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable

from urbihw_fakes.endpoint import TcpEndpoint
from urbihw_fakes.serving import CHUNK
from urbihw_fakes.spykee.device import REFUSED, Spykee
from urbihw_fakes.spykee.packets import LOGIN

QUESTION = b"DSCV\x01"
MOST_WAITING = 8


class SpykeeEndpoint(TcpEndpoint):
    """The TCP port of a robot and the UDP port that answers searches.  `port` 0: any free port for both."""

    device: Spykee

    def __init__(
        self,
        device: Spykee,
        port: int = 0,
        *,
        address: str = "127.0.0.1",
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._address = address
        self._ear: socket.socket | None = None
        self._mouth: socket.socket | None = None
        self._others: dict[int, socket.socket] = {}
        device.on_close = self._hang_up
        super().__init__(device, port, clock=clock)

    @property
    def url(self) -> str:
        """`spykee://`, the address and the port."""
        return f"spykee://{self._address}:{self.port}"

    def _plug(self) -> None:
        self._listener = socket.create_server((self._address, self.port), backlog=4)
        self.port = self._listener.getsockname()[1]
        # What is sent to everybody comes to all who listen at this port; the answer must come from the own address.
        self._ear = self._datagrams("")
        self._mouth = self._datagrams(self._address)

    def _datagrams(self, address: str) -> socket.socket:
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((address, self.port))
        made.setblocking(False)
        return made

    def _unplug(self) -> None:
        super()._unplug()
        self.device.disconnect()
        for each in (self._ear, self._mouth, *self._others.values()):
            if each is not None:
                each.close()
        self._ear = self._mouth = None
        self._others.clear()

    def _hang_up(self) -> None:
        self._drop_peer()

    def _readers(self) -> list[int]:
        if self._listener is None or self._ear is None or self._mouth is None:
            return []
        peer = [] if self._peer is None else [self._peer.fileno()]
        return [*peer, self._listener.fileno(), self._ear.fileno(), self._mouth.fileno(), *self._others]

    def _receive(self, ready: int) -> bytes:
        if self._peer is not None and ready == self._peer.fileno():
            data = super()._receive(ready)
            if self._peer is None:
                self.device.disconnect()
            return data
        for ear in (self._ear, self._mouth):
            if ear is not None and ready == ear.fileno():
                self._answer(ear)
                return b""
        if ready in self._others:
            self._refuse(ready)
        elif self._listener is not None and ready == self._listener.fileno():
            self._accept(self._listener)
        return b""

    def _accept(self, listener: socket.socket) -> None:
        peer, _ = listener.accept()
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if self._peer is None:
            self._peer = peer
            self.device.connect()
        elif len(self._others) < MOST_WAITING:
            self._others[peer.fileno()] = peer
        else:
            peer.close()

    def _refuse(self, ready: int) -> None:
        """Somebody has the robot; another login gets this answer, and the line is closed."""
        other = self._others.pop(ready)
        with contextlib.suppress(OSError):
            data = other.recv(CHUNK)
            if data[2:3] == bytes([LOGIN]):
                other.sendall(REFUSED)
        other.close()

    def _answer(self, ear: socket.socket) -> None:
        with contextlib.suppress(OSError):
            data, asker = ear.recvfrom(CHUNK)
            if data == QUESTION and self._mouth is not None and self.device.body.powered:
                self._mouth.sendto(self.device.discovered(), asker)
