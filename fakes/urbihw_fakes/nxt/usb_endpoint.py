"""A brick plugged into a simulated USB bus, for a host in another process.

The bus is a folder, and a plugged device is a socket in it, named by its serial number: a packet through the socket is
a transfer of a bulk endpoint.  Plugging makes the socket; unplugging removes it and closes the connection.  A host that
connects claims the interface: the first gets `CLAIMED`, a second one `TAKEN`.  The host uses `usb_backend`.
"""

from __future__ import annotations

import os
import socket
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from urbihw_fakes.nxt.stream import HEAD, NxtDevice, framed
from urbihw_fakes.serving import CHUNK, Endpoint

CLAIMED = b"claimed"
TAKEN = b"taken"
PRODUCT = "0694:0002"
BACKEND = "urbihw_fakes.nxt.usb_backend:bus"


class UsbEndpoint(Endpoint):
    """A brick on the bus `folder`; without one, a folder is made, and removed by `close`."""

    def __init__(
        self, device: NxtDevice, folder: str | None = None, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(device, clock=clock)
        self._brick_device = device
        self._own_folder = folder is None
        self.folder = folder if folder is not None else tempfile.mkdtemp(prefix="usb-bus-")
        self._listener: socket.socket | None = None
        self._peer: socket.socket | None = None
        self._plug()

    @property
    def url(self) -> str:
        """`usb://`, naming the simulated bus that stands in for libusb."""
        return f"usb://{PRODUCT}?backend={BACKEND}&at={self.folder}"

    @property
    def plugged(self) -> bool:
        """True while the cable is in."""
        return self._listener is not None

    def close(self) -> None:
        """Unplug the brick, and remove the folder if this endpoint made it."""
        super().close()
        if self._own_folder:
            Path(self.folder).rmdir() if os.path.isdir(self.folder) else None

    def _plug(self) -> None:
        folder = Path(self.folder)
        folder.mkdir(exist_ok=True)
        path = folder / self._brick_device.brick.serial
        path.unlink(missing_ok=True)
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        listener.bind(str(path))
        listener.listen()
        self._listener = listener

    def _unplug(self) -> None:
        self._drop_peer()
        self._brick_device.hang_up()
        if self._listener is not None:
            Path(self._listener.getsockname()).unlink(missing_ok=True)
            self._listener.close()
            self._listener = None

    def _drop_peer(self) -> None:
        if self._peer is not None:
            self._peer.close()
            self._peer = None

    def _readers(self) -> list[int]:
        # Close the peer first: when it has released the interface, the next host must find it free.
        return [each.fileno() for each in (self._peer, self._listener) if each is not None]

    def _receive(self, ready: int) -> bytes:
        if self._peer is None or ready != self._peer.fileno():
            self._greet()
            return b""
        try:
            packet = self._peer.recv(CHUNK)
        except OSError:
            packet = b""
        if not packet:
            self._drop_peer()
            return b""
        return framed(packet)

    def _greet(self) -> None:
        assert self._listener is not None
        peer, _ = self._listener.accept()
        peer.send(CLAIMED if self._peer is None else TAKEN)
        if self._peer is None:
            self._peer = peer
        else:
            peer.close()

    def _send(self, data: bytes) -> None:
        """Send one packet for each reply in `data`; data damaged by a fault is sent as it is."""
        while data and self._peer is not None:
            end = HEAD + int.from_bytes(data[:HEAD], "little")
            packet, data = data[HEAD:end], data[end:]
            try:
                self._peer.send(packet or b"\0", socket.MSG_DONTWAIT)
            except OSError:
                # The host is gone or does not read: the packet is lost.
                return
