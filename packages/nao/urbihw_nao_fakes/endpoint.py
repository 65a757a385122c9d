"""A Nao on the network: NAOqi's port, with several clients at a time."""

from __future__ import annotations

import contextlib
import socket
import ssl
import time
from collections.abc import Callable

from urbihw_fakes.endpoint import TcpEndpoint
from urbihw_fakes.serving import CHUNK
from urbihw_nao_fakes.connection import Connection
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.machine import find_machine_id
from urbihw_nao_fakes.services import Failed
from urbihw_nao_fakes.tls import Identity

SEND_TIMEOUT_S = 1.0
"""How long a client may not read while there is something to send."""
DIAL_TIMEOUT_S = 1.0
HANDSHAKE_TIMEOUT_S = 1.0


class NaoEndpoint(TcpEndpoint):
    """See the head of this file.  `port` 0 takes a free one; with an `identity` it speaks TLS."""

    device: Nao

    def __init__(
        self,
        device: Nao,
        port: int = 0,
        *,
        identity: Identity | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.identity = identity
        self._peers: dict[int, tuple[socket.socket, Connection]] = {}
        device.directory.machine = find_machine_id()
        super().__init__(device, port, clock=clock)
        device.server.dial = self._dial

    @property
    def url(self) -> str:
        """`qi://127.0.0.1:` and the port; `qis://` with an identity."""
        return f"qi{'s' if self.identity else ''}://127.0.0.1:{self.port}"

    def _plug(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", self.port), backlog=8)
        self.port = self._listener.getsockname()[1]
        self.device.endpoint = f"tcp{'s' if self.identity else ''}://127.0.0.1:{self.port}"

    def _unplug(self) -> None:
        super()._unplug()
        for number in list(self._peers):
            self._drop(number)

    def _drop(self, number: int) -> None:
        peer, connection = self._peers.pop(number)
        self.device.disconnect(connection)
        peer.close()

    def _accept(self, peer: socket.socket) -> None:
        if self.identity is not None:
            peer.settimeout(HANDSHAKE_TIMEOUT_S)
            try:
                peer = self.identity.context.wrap_socket(peer, server_side=True)
            except OSError:
                peer.close()
                return
        self._add(peer)

    def _add(self, peer: socket.socket) -> Connection:
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        peer.settimeout(SEND_TIMEOUT_S)
        connection = self.device.connect()
        self._peers[peer.fileno()] = peer, connection
        return connection

    def _dial(self, url: str) -> Connection:
        """Connect to a client that has a service of its own.  Raises Failed."""
        host, _, port = url.removeprefix("tcp://").rpartition(":")
        try:
            return self._add(socket.create_connection((host, int(port)), DIAL_TIMEOUT_S))
        except (OSError, ValueError) as error:
            raise Failed(f"{url}: {error}") from error

    def _readers(self) -> list[int]:
        return [] if self._listener is None else [self._listener.fileno(), *self._peers]

    def _receive(self, ready: int) -> bytes:
        if self._listener is not None and ready == self._listener.fileno():
            self._accept(self._listener.accept()[0])
            return b""
        peer, connection = self._peers[ready]
        data = b""
        with contextlib.suppress(OSError):
            data = peer.recv(CHUNK)
            # What TLS has decrypted already is nothing that `select` sees.
            while isinstance(peer, ssl.SSLSocket) and peer.pending():
                data += peer.recv(CHUNK)
        if not data:
            self._drop(ready)
            return b""
        self.device.receive_from(connection, data, self.clock())
        self._deliver(self.clock())
        return b""

    def _deliver(self, now: float) -> None:
        server = self.device.server
        due = self.device.due()
        if due is not None and due <= now:
            self.device.tick(now)
        unsent, server.unsent = server.unsent, []
        sockets = {id(connection): peer for peer, connection in self._peers.values()}
        for connection, answer in unsent:
            if answer.at > now:
                server.unsent.append((connection, answer))
            elif (peer := sockets.get(id(connection))) is not None:
                try:
                    peer.sendall(answer.data)
                except OSError:
                    # It does not read, or is gone; after a part of a message nothing more can be sent.
                    connection.closed = True
        for number, (_, connection) in list(self._peers.items()):
            if connection.closed:
                self._drop(number)
