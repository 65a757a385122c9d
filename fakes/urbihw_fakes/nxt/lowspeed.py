"""The I2C side of the input ports, and what can be plugged into it (firmware: c_lowspeed.c).

Bus of 9600 bit/s, 16 bytes each way.  What was read stays in a ring until LSREAD takes it, so that a host that does not
clear it gets old bytes with the next answer, as from the brick.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from urbihw_fakes.nxt import codes
from urbihw_fakes.nxt.inputs import Plugged

RING = 16
BIT = 1 / 9600  # s
BITS_PER_BYTE = 9  # eight and the acknowledge
OVERHEAD = 0.002  # s, of the firmware around a transfer
WARM_UP = 0.1  # s from the setting of the type to the first transfer
NO_ECHO = 255


class I2cDevice(Plugged):
    """Something with registers: a write sets the register pointer and then registers, a read goes on from it."""

    def __init__(self, address: int = 0x02, registers: bytes = b"") -> None:
        self.address = address
        self.registers = bytearray(registers.ljust(256, b"\0"))
        self.pointer = 0

    def write(self, data: bytes) -> None:
        """What followed the address."""
        if data:
            self.pointer = data[0]
            for offset, byte in enumerate(data[1:]):
                self.store(self.pointer + offset & 0xFF, byte)

    def read(self, count: int) -> bytes:
        """The registers from the pointer on."""
        return bytes(self.fetch(self.pointer + offset & 0xFF) for offset in range(count))

    def store(self, register: int, value: int) -> None:
        """Write a register; override where that does something."""
        self.registers[register] = value

    def fetch(self, register: int) -> int:
        """Read a register; override where it is made when asked for."""
        return self.registers[register]


class Ultrasonic(I2cDevice):
    """The ultrasonic sensor.  `distance()` gives what is before it, in cm; 255 is no echo.

    LEGO, NXT Hardware Developer Kit, appendix 7: texts at 00, 08, 10 and 14 (each is read as a whole, so that the text
    at 10 does not run into the registers 11 to 13), command at 41, measurements from 42 on.
    """

    TEXTS = {0x00: b"V1.0", 0x08: b"LEGO", 0x10: b"Sonar", 0x14: b"10E-2m"}

    COMMAND = 0x41
    FIRST = 0x42
    OFF, SINGLE, CONTINUOUS, RESET = 0, 1, 2, 4

    def __init__(self, distance: Callable[[], int] = lambda: NO_ECHO) -> None:
        super().__init__()
        self.distance = distance
        self.registers[0x12], self.registers[0x13] = 0x01, 0x0E
        self.registers[0x51], self.registers[0x52] = 0x01, 0x0E
        self.registers[self.COMMAND] = self.CONTINUOUS
        self._measured = bytes([NO_ECHO] * 8)

    def read(self, count: int) -> bytes:
        """See `I2cDevice`."""
        text = self.TEXTS.get(self.pointer)
        return super().read(count) if text is None else text.ljust(count, b"\0")[:count]

    def store(self, register: int, value: int) -> None:
        """See `I2cDevice`; a command takes effect."""
        super().store(register, value)
        if register != self.COMMAND:
            return
        if value == self.SINGLE:
            self._measured = bytes([self._now(), *[NO_ECHO] * 7])
            self.registers[register] = self.OFF
        elif value == self.RESET:
            self.registers[register] = self.CONTINUOUS

    def fetch(self, register: int) -> int:
        """See `I2cDevice`; measurements are made when asked for, in continuous mode."""
        if self.FIRST <= register < self.FIRST + 8:
            if register == self.FIRST and self.registers[self.COMMAND] == self.CONTINUOUS:
                return self._now()
            return self._measured[register - self.FIRST]
        return super().fetch(register)

    def _now(self) -> int:
        return max(0, min(NO_ECHO, self.distance()))


@dataclass
class Channel:
    """The bus of one port.

    Attributes:
        failed: nobody acknowledged the last transfer.
        busy_until: when the transfer under way is over.
    """

    configured_at: float | None = None
    failed: bool = False
    busy_until: float = 0.0
    _coming: bytes = b""
    _ring: bytearray = field(default_factory=bytearray)

    def configure(self, kind: int, now: float) -> None:
        """The port was set to this type."""
        if kind not in (codes.LOWSPEED, codes.LOWSPEED_9V):
            self.configured_at = None
        elif self.configured_at is None:
            self.configured_at = now

    def write(self, plugged: Plugged, data: bytes, count: int, now: float) -> int:
        """LSWRITE: begin a transfer; the status."""
        if self.configured_at is None or now - self.configured_at < WARM_UP or now < self.busy_until:
            return codes.BUSY
        if not 0 < len(data) <= RING or count > RING:
            return codes.ILLEGAL_SIZE
        self._settle(now)
        bits = (len(data) + (count + 1 if count else 0)) * BITS_PER_BYTE
        self.busy_until = now + bits * BIT + OVERHEAD
        self.failed = not (isinstance(plugged, I2cDevice) and data[0] == plugged.address)
        self._coming = b""
        if isinstance(plugged, I2cDevice) and not self.failed:
            plugged.write(data[1:])
            self._coming = plugged.read(count)
        return codes.OK

    def status(self, now: float) -> tuple[int, int]:
        """LSGETSTATUS: the status, and how many bytes are ready."""
        if self.configured_at is None:
            return codes.BUSY, 0
        if now < self.busy_until:
            return codes.PENDING, 0
        self._settle(now)
        return (codes.BUS_ERROR, 0) if self.failed else (codes.OK, len(self._ring))

    def read(self, now: float) -> tuple[int, bytes]:
        """LSREAD: the status and the bytes that were ready."""
        status, _ = self.status(now)
        if status != codes.OK:
            return status, b""
        data = bytes(self._ring)
        self._ring.clear()
        return codes.OK, data

    def _settle(self, now: float) -> None:
        self._ring += self._coming
        del self._ring[:-RING]
        self._coming = b""
