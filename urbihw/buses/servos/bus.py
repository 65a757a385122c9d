"""Operations on a Dynamixel bus: ping, read, write, with retries, and with refusals raised as exceptions.

with buses.open_link("/dev/ttyUSB0?baud=1000000") as link:
    bus = ServoBus(link, "auto")
    for device in scan(bus).devices:                    # urbihw.buses.servos.scan
        print(device.id, device.name, bus.read(device.id, 36, 2))
"""

from __future__ import annotations

from collections.abc import Mapping

from urbihw.buses.errors import BadFrame, BusTimeout, DeviceRefused
from urbihw.buses.servos import packet
from urbihw.buses.servos.status import Status, refusal_words
from urbihw.buses.servos.transactions import TransactionChannel

_RETRIES = 2


class ServoBus(TransactionChannel):
    """A channel with retried operations."""

    def ping(self, device: int, retries: int = _RETRIES) -> Status:
        """Ping; protocol 2.0 answers model and firmware. Raises BusTimeout, BadFrame, LinkGone."""
        protocol = self.protocol_of(device)
        size = 3 if protocol == 2 else 0
        return self.ask_with_retries(packet.ping_packet(protocol, device), device, size, retries)

    def read(self, device: int, address: int, size: int, retries: int = _RETRIES) -> bytes:
        """Return `size` bytes from `address`. Raises BusTimeout, BadFrame, DeviceRefused, LinkGone."""
        request = packet.read_packet(self.protocol_of(device), device, address, size)
        return self._raise_refusal(self.ask_with_retries(request, device, size, retries)).params

    def write(self, device: int, address: int, data: bytes, answered: bool = True, retries: int = _RETRIES) -> None:
        """Write `data`; `answered=False` for a device whose status return level is below 2, or for all (254).

        Raises BusTimeout, BadFrame, DeviceRefused, LinkGone.
        """
        request = packet.write_packet(self.protocol_of(device), device, address, data)
        self._send_command(request, device, answered, retries)

    def reboot(self, device: int) -> None:
        """Restart a protocol 2.0 device, the only way to clear a hardware alert. Raises as `write`."""
        self._send_command(packet.reboot_packet(device), device, True, 0)

    def sync_write(self, address: int, values: Mapping[int, bytes]) -> None:
        """Write the same registers of several devices in one packet, unacknowledged. Raises BadValue, LinkGone."""
        self.send(packet.sync_write_packet(self.protocol, address, values))

    def ask_with_retries(self, request: bytes, device: int, size: int, retries: int) -> Status:
        """As `ask`, repeated up to `retries` times."""
        first = self.clock.now()
        for left in range(retries, -1, -1):
            try:
                status = self.ask(request, device, size)
                break
            except (BusTimeout, BadFrame):
                if not left:
                    raise
                self.counters.retried += 1
                last = self.clock.now()
        if left < retries:
            # This may be the late answer to the first try; discard the one to the last, or the next request takes it.
            self.discard_until(self.clock.now() + (last - first) + self.response_timeout.allowance)
        return status

    def discard_until(self, until: float) -> None:
        """Pass over what still comes, until a time."""
        while self.link.read(1024, until):
            pass
        self._overdue = None

    def _send_command(self, request: bytes, device: int, answered: bool, retries: int) -> None:
        if device == packet.BROADCAST or not answered:
            self.send(request)
        else:
            self._raise_refusal(self.ask_with_retries(request, device, 0, retries))

    def _raise_refusal(self, status: Status) -> Status:
        refusal = status.refusal
        # An answer with data is valid: an AX servo whose goal is outside its limits sets "angle limit" in each answer.
        if refusal and not status.params:
            self.counters.refused += 1
            raise DeviceRefused(status.device, status.error, refusal_words(refusal, status.protocol))
        return status
