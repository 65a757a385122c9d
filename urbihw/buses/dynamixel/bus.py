"""Errands on a Dynamixel wire: ping, read, write, with retries and with refusals raised.

with buses.open_link("/dev/ttyUSB0?baud=1000000") as link:
    bus = DynamixelBus(link, "auto")
    for device in scan(bus).devices:                    # urbihw.buses.dynamixel.scan
        print(device.id, device.name, bus.read(device.id, 36, 2))
"""

from __future__ import annotations

from collections.abc import Mapping

from urbihw.buses.dynamixel import packet
from urbihw.buses.dynamixel.status import Status, refusal_words
from urbihw.buses.dynamixel.wire import Wire
from urbihw.buses.errors import BadFrame, BusTimeout, DeviceRefused

_RETRIES = 2


class DynamixelBus(Wire):
    """Ask a device for something until it answers."""

    def ping(self, device: int, retries: int = _RETRIES) -> Status:
        """Ping; protocol 2.0 answers model and firmware. Raises BusTimeout, BadFrame, LinkGone."""
        size = 3 if self.protocol == 2 else 0
        return self.insist(packet.ping_packet(self.protocol, device), device, size, retries)

    def read(self, device: int, address: int, size: int, retries: int = _RETRIES) -> bytes:
        """Return `size` bytes from `address`. Raises BusTimeout, BadFrame, DeviceRefused, LinkGone."""
        request = packet.read_packet(self.protocol, device, address, size)
        return self._accepted(self.insist(request, device, size, retries)).params

    def write(self, device: int, address: int, data: bytes, answered: bool = True, retries: int = _RETRIES) -> None:
        """Write `data`; `answered=False` for a device whose status return level is below 2, or for all (254).

        Raises BusTimeout, BadFrame, DeviceRefused, LinkGone.
        """
        self._order(packet.write_packet(self.protocol, device, address, data), device, answered, retries)

    def reboot(self, device: int) -> None:
        """Restart a protocol 2.0 device: the only cure for a hardware alert. Raises as `write`."""
        self._order(packet.reboot_packet(device), device, True, 0)

    def sync_write(self, address: int, values: Mapping[int, bytes]) -> None:
        """Write the same registers of several devices in one packet; nobody confirms. Raises BadValue, LinkGone."""
        self.send(packet.sync_write_packet(self.protocol, address, values))

    def insist(self, request: bytes, device: int, size: int, retries: int) -> Status:
        """As `ask`, repeated up to `retries` times."""
        first = last = self.clock.now()
        for left in range(retries, -1, -1):
            last = self.clock.now()
            try:
                status = self.ask(request, device, size)
                break
            except (BusTimeout, BadFrame):
                if not left:
                    raise
                self.counters.retried += 1
        if last > first:
            # This may be the late answer to the first try; the one to the last must not answer the next question.
            self._swallow(self.clock.now() + (last - first) + self.patience.allowance)
        return status

    def _swallow(self, until: float) -> None:
        while self.link.read(1024, until):
            pass
        self._overdue = None

    def _order(self, request: bytes, device: int, answered: bool, retries: int) -> None:
        if device == packet.BROADCAST or not answered:
            self.send(request)
        else:
            self._accepted(self.insist(request, device, 0, retries))

    def _accepted(self, status: Status) -> Status:
        refusal = status.refusal
        # Data is data: an AX servo whose goal lies outside its limits says "angle limit" in each answer.
        if refusal and not status.params:
            self.counters.refused += 1
            raise DeviceRefused(status.device, status.error, refusal_words(refusal, status.protocol))
        return status
