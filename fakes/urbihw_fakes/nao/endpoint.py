"""A Nao on the network: NAOqi's port, with several clients at a time."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable

from urbihw_fakes.endpoint import TcpEndpoint
from urbihw_fakes.nao.device import Connection, Nao
from urbihw_fakes.serving import CHUNK


class NaoEndpoint(TcpEndpoint):
    """See the head of this file.  `port` 0 takes a free one."""

    device: Nao

    def __init__(self, device: Nao, port: int = 0, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._peers: dict[int, tuple[socket.socket, Connection]] = {}
        super().__init__(device, port, clock=clock)

    @property
    def url(self) -> str:
        """`qi://127.0.0.1:` and the port."""
        return f"qi://127.0.0.1:{self.port}"

    def _plug(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", self.port), backlog=8)
        self.port = self._listener.getsockname()[1]
        self.device.endpoint = f"tcp://127.0.0.1:{self.port}"

    def _unplug(self) -> None:
        super()._unplug()
        for number in list(self._peers):
            self._drop(number)

    def _drop(self, number: int) -> None:
        peer, connection = self._peers.pop(number)
        self.device.disconnect(connection)
        peer.close()

    def _readers(self) -> list[int]:
        return [] if self._listener is None else [self._listener.fileno(), *self._peers]

    def _receive(self, ready: int) -> bytes:
        if self._listener is not None and ready == self._listener.fileno():
            peer, _ = self._listener.accept()
            peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._peers[peer.fileno()] = peer, self.device.connect()
            return b""
        peer, connection = self._peers[ready]
        data = b""
        with contextlib.suppress(OSError):
            data = peer.recv(CHUNK)
        if not data:
            self._drop(ready)
            return b""
        self.device.receive_from(connection, data, self.clock())
        self._deliver(self.clock())
        return b""

    def _deliver(self, now: float) -> None:
        due = self.device.due()
        if due is not None and due <= now:
            self.device.tick(now)
        unsent, self.device.unsent = self.device.unsent, []
        sockets = {id(connection): peer for peer, connection in self._peers.values()}
        for connection, answer in unsent:
            if answer.at > now:
                self.device.unsent.append((connection, answer))
            elif (peer := sockets.get(id(connection))) is not None:
                with contextlib.suppress(OSError):
                    peer.sendall(answer.data, socket.MSG_DONTWAIT)
        for number, (_, connection) in list(self._peers.items()):
            if connection.closed:
                self._drop(number)
