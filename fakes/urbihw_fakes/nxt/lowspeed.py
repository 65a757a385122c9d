"""The I2C side of the input ports, and the devices for it (firmware: c_lowspeed.c).

Bus of 9600 bit/s, 16 bytes each way.  Received bytes stay in a ring buffer until LSREAD, as in the brick: a host that
does not clear it gets old bytes with the next answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from urbihw_fakes.nxt import codes
from urbihw_fakes.nxt.inputs import Plugged

RING = 16
BIT = 1 / 9600  # s
BITS_PER_BYTE = 9  # bits per byte, with the acknowledge bit
OVERHEAD = 0.002  # s, overhead of the firmware per transfer
WARM_UP = 0.1  # s from SETINPUTMODE to the first transfer
NO_ECHO = 255


class I2cDevice(Plugged):
    """A device with registers: a write sets the register pointer and then registers, a read continues from it."""

    def __init__(self, address: int = 0x02, registers: bytes = b"") -> None:
        self.address = address
        self.registers = bytearray(registers.ljust(256, b"\0"))
        self.pointer = 0

    def write(self, data: bytes) -> None:
        """Process the bytes after the address."""
        if data:
            self.pointer = data[0]
            for offset, byte in enumerate(data[1:]):
                self.store(self.pointer + offset & 0xFF, byte)

    def read(self, count: int) -> bytes:
        """Return registers, beginning at the pointer."""
        return bytes(self.fetch(self.pointer + offset & 0xFF) for offset in range(count))

    def store(self, register: int, value: int) -> None:
        """Write a register; override it if the write has an effect."""
        self.registers[register] = value

    def fetch(self, register: int) -> int:
        """Read a register; override it if the value is computed."""
        return self.registers[register]


class Ultrasonic(I2cDevice):
    """The ultrasonic sensor.  `distance()` returns the distance of the object in front, in cm; 255 without an echo.

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
        """Return a text register as a whole, other registers byte by byte."""
        text = self.TEXTS.get(self.pointer)
        return super().read(count) if text is None else text.ljust(count, b"\0")[:count]

    def store(self, register: int, value: int) -> None:
        """Write a register; a write of the command register takes effect at once."""
        super().store(register, value)
        if register != self.COMMAND:
            return
        if value == self.SINGLE:
            self._measured = bytes([self._now(), *[NO_ECHO] * 7])
            self.registers[register] = self.OFF
        elif value == self.RESET:
            self.registers[register] = self.CONTINUOUS

    def fetch(self, register: int) -> int:
        """Return a register; in continuous mode, a read of the first distance measures."""
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
        failed: the last transfer had no acknowledgement.
        busy_until: end of the present transfer.
    """

    configured_at: float | None = None
    failed: bool = False
    busy_until: float = 0.0
    _coming: bytes = b""
    _ring: bytearray = field(default_factory=bytearray)

    def configure(self, kind: int, now: float) -> None:
        """Set the type of the port."""
        if kind not in (codes.LOWSPEED, codes.LOWSPEED_9V):
            self.configured_at = None
        elif self.configured_at is None:
            self.configured_at = now

    def write(self, plugged: Plugged, data: bytes, count: int, now: float) -> int:
        """LSWRITE: begin a transfer; return the status."""
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
        """LSGETSTATUS: return the status, and the number of bytes that are ready."""
        if self.configured_at is None:
            return codes.BUSY, 0
        if now < self.busy_until:
            return codes.PENDING, 0
        self._settle(now)
        return (codes.BUS_ERROR, 0) if self.failed else (codes.OK, len(self._ring))

    def read(self, now: float) -> tuple[int, bytes]:
        """LSREAD: return the status and the bytes that are ready."""
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
