"""A Slamtec RPLIDAR A1 on a serial line: 5.5 turns of 360 measurements a second, sent as they are made.

Source: Slamtec, "Interface Protocol and Application Notes, applied to RPLIDAR A1 & A2", rev. 1.1 (2018).
"""

from __future__ import annotations

import math
import threading

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.lasers.rays import Carrier, distances

BAUD = 115200
TURNS_PER_S = 5.5
PER_TURN = 360
PIECES = 10
"""Parts of a turn that are sent at once."""
FARTHEST, NEAREST = 12.0, 0.15
STOP, RESET, SCAN, FORCE_SCAN, INFO, HEALTH, MOTOR = 0x25, 0x40, 0x20, 0x21, 0x50, 0x52, 0xF0
MODEL, FIRMWARE, HARDWARE = 0x18, (1, 29), 7
SERIAL = bytes(range(16))


class Rplidar(Device):
    """The laser of ``body``; ``lock`` is held during every access to the body.

    Attributes:
        scanning: it sends measurements; powered: it has power; broken: it reports an error; duty: of the motor.
    """

    model = "rplidar"
    """``laser_model`` in the settings."""

    def __init__(self, body: Carrier, lock: threading.RLock | None = None) -> None:
        super().__init__()
        self.body = body
        self.lock = lock if lock is not None else threading.RLock()
        self.powered = True
        self.scanning = self.broken = False
        self.duty = 0
        self._heard = b""
        self._piece = 0
        self._next = 0.0

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Receive bytes; at another line speed they are noise and ignored."""
        if not self.powered or self.baud not in (None, BAUD):
            return []
        self._heard += data
        answers: list[Answer] = []
        while b"\xa5" in self._heard:
            self._heard = self._heard[self._heard.index(0xA5) :]
            size = self._size()
            if len(self._heard) < size:
                return answers
            packet, self._heard = self._heard[:size], self._heard[size:]
            answers += self._execute(packet, now)
        self._heard = b""
        return answers

    def due(self) -> float | None:
        """When the next measurements go out."""
        return self._next if self.scanning and self.powered else None

    def tick(self, now: float) -> list[Answer]:
        """A part of a turn, if it is time for one."""
        if not self.scanning or not self.powered or now < self._next:
            return []
        period = 1 / TURNS_PER_S / PIECES
        self._next = max(self._next + period, now + period / 2)
        data = self._measure(now)
        self._piece = (self._piece + 1) % PIECES
        return self._send(data, now)

    def power_off(self, now: float, who: int | None = None) -> None:
        self.powered = self.scanning = False

    def power_on(self, now: float, who: int | None = None) -> None:
        """Power on: it does not scan by itself."""
        self.powered = True

    def _size(self) -> int:
        """Bytes of the packet at the beginning of what was heard."""
        if len(self._heard) < 2 or not self._heard[1] & 0x80:
            return 2
        return 4 + self._heard[2] if len(self._heard) > 2 else 3

    def _execute(self, packet: bytes, now: float) -> list[Answer]:
        command = packet[1]
        if command in (STOP, RESET):
            self.scanning = False
        elif command == MOTOR:
            check = 0
            for byte in packet[:-1]:
                check ^= byte
            if check == packet[-1] and len(packet) == 6:
                self.duty = packet[3] | packet[4] << 8
        elif command in (SCAN, FORCE_SCAN):
            self.scanning, self._piece, self._next = True, 0, now + 0.1
            return self._send(_descriptor(5, 1, 0x81), now)
        elif command == INFO and not self.scanning:
            data = bytes((MODEL, FIRMWARE[1], FIRMWARE[0], HARDWARE)) + SERIAL
            return self._send(_descriptor(20, 0, 0x04) + data, now)
        elif command == HEALTH and not self.scanning:
            return self._send(_descriptor(3, 0, 0x06) + bytes((2 if self.broken else 0, 0x10 * self.broken, 0)), now)
        return []

    def _measure(self, now: float) -> bytes:
        """The measurements of this part of the turn, clockwise from the front."""
        numbers = range(self._piece * PER_TURN // PIECES, (self._piece + 1) * PER_TURN // PIECES)
        with self.lock:
            self.body.advance(now)
            seen = distances(self.body, [-math.radians(number + 0.5) for number in numbers], FARTHEST)
        data = b""
        for number, metres in zip(numbers, seen, strict=True):
            start = number == 0
            good = NEAREST <= metres < FARTHEST
            angle, distance = round((number + 0.5) * 64), round(metres * 4000) if good else 0
            data += bytes((15 << 2 | (not start) << 1 | start, (angle & 0x7F) << 1 | 1, angle >> 7))
            data += distance.to_bytes(2, "little")
        return data

    def _send(self, data: bytes, now: float) -> list[Answer]:
        delay, data = self.faults.disturb(0, data)
        return [Answer(now + delay + len(data) * self.byte_time, data)] if data else []


def _descriptor(length: int, mode: int, kind: int) -> bytes:
    return b"\xa5\x5a" + (length | mode << 30).to_bytes(4, "little") + bytes((kind,))
