"""A CAN node on any interface of python-can, served by the loop of all fakes.

    device = CanDevice(SegwayRmp(), Records())
    with BusEndpoint(device, "udp_multicast", "239.74.163.2", port=43113, hop_limit=0) as end:
        end.start()          # end.url is "can://udp_multicast/239.74.163.2?port=43113&hop_limit=0"

The interface must have a file descriptor to wait for: `udp_multicast` and `socketcan` have, `virtual` has not.
With `hop_limit=0` multicast stays on this machine. Anybody there may join in, so what comes in is checked.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any
from urllib.parse import urlencode

import can

from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.node import CanFrame
from urbihw_fakes.can.records import Records
from urbihw_fakes.errors import FakeError
from urbihw_fakes.serving import Endpoint


class BusEndpoint(Endpoint):
    """Serves a device that speaks `Records` on the bus that `can.Bus(interface=..., channel=..., **options)` opens.

    Raises:
        FakeError: the bus cannot be opened, or has nothing to wait for.
    """

    def __init__(
        self,
        device: CanDevice,
        interface: str,
        channel: str,
        *,
        clock: Callable[[], float] = time.monotonic,
        **options: Any,
    ) -> None:
        super().__init__(device, clock=clock)
        self._interface, self._channel, self._options = interface, channel, options
        self._bus: can.BusABC | None = None
        self._codec = Records()
        self._plug()

    @property
    def url(self) -> str:
        """`can://`, the interface and the channel."""
        query = f"?{urlencode(self._options)}" if self._options else ""
        return f"can://{self._interface}/{self._channel}{query}"

    @property
    def plugged(self) -> bool:
        """True while the node is on the bus."""
        return self._bus is not None

    def _plug(self) -> None:
        try:
            bus = can.Bus(channel=self._channel, interface=self._interface, **self._options)
        except (can.CanError, OSError, ValueError, ImportError) as error:
            raise FakeError(f"{self.url}: {error}") from error
        try:
            bus.fileno()
        except NotImplementedError as error:
            bus.shutdown()
            raise FakeError(f"{self._interface}: there is nothing to wait for; choose udp_multicast") from error
        self._bus = bus

    def _unplug(self) -> None:
        if self._bus is not None:
            self._bus.shutdown()
            self._bus = None

    def _readers(self) -> list[int]:
        return [self._bus.fileno()] if self._bus is not None else []

    def _receive(self, ready: int) -> bytes:
        if self._bus is None:
            return b""
        try:
            message = self._bus.recv(0)
        except (can.CanError, ValueError):
            # Somebody else's datagram.
            return b""
        if message is None or message.is_extended_id or message.is_remote_frame or message.is_error_frame:
            return b""
        return self._codec.encode(CanFrame(message.arbitration_id, bytes(message.data)[:8]))

    def _send(self, data: bytes) -> None:
        frames, _ = self._codec.decode(data)
        for frame in frames:
            message = can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=False)
            try:
                if self._bus is not None:
                    self._bus.send(message)
            except can.CanError:
                # No node takes it: lost, as on a wire.
                pass
