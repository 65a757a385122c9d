"""A SICK LMS200 on a line of its own: 180 degrees, 181 readings, in mm.

Each answer is preceded by one single byte, 0x06 (ACK) or 0x15 (NAK).  The scan rate is limited by the line: about 2.5
per second at 9600 baud, 10 at 38400, 75 at 500000.
"""

from __future__ import annotations

import math
import struct
import threading

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.p3dx.body import Body
from urbihw_fakes.p3dx.codec import SickReader, sick_telegram
from urbihw_fakes.p3dx.simlaser import scan

ADDRESS = 0x80
# Commands, and the answers, which have bit 7 set (SICK, "Telegrams for configuring and operating the LMS2xx").
RESET, OPERATING_MODE, REQUEST_DATA, REQUEST_STATUS = b"\x10", b"\x20", b"\x30", b"\x31"
REQUEST_TYPE, SET_VARIANT = b"\x3a", b"\x3b"
RESET_REPLY, NOT_ACCEPTED, MODE_REPLY, DATA_REPLY = b"\x90", b"\x92", b"\xa0", b"\xb0"
STATUS_REPLY, TYPE_REPLY, VARIANT_REPLY = b"\xb1", b"\xba", b"\xbb"
# Operating modes, behind OPERATING_MODE; a baud rate of BAUDS is one too.
SEND_SCANS, SEND_ON_REQUEST, CONFIGURE = b"\x24", b"\x25", b"\x00"
UNDERSTOOD, NOT_UNDERSTOOD = b"\x06", b"\x15"
STATUS = 0x10
BAUDS = {0x42: 9600, 0x41: 19200, 0x40: 38400, 0x48: 500000}
RATES = {9600: 2.5, 19200: 5.0, 38400: 10.0, 500000: 75.0}
TYPE_TEXT = b"LMS200;30106;V02.10"
FARTHEST = 8.182
NO_ECHO = 0x1FFF
RESOLUTIONS = (25, 50, 100)


class SickLaser(Device):
    """The laser of ``body``; ``lock`` is held during every access to the body.

    Attributes:
        host_baud: its line speed; scanning: it sends scans continuously; dirty: its window is polluted.
    """

    model = "lms200"
    """``laser_model`` in the settings."""

    def __init__(self, body: Body, lock: threading.RLock | None = None) -> None:
        super().__init__()
        self.body = body
        self.lock = lock if lock is not None else threading.RLock()
        self.host_baud = 9600
        self.powered = True
        self.scanning = False
        self.dirty = False
        self.angle, self.resolution = 180, 100
        self._reader = SickReader()
        self._next = 0.0

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Receive bytes; at another line speed they are noise and ignored."""
        if not self.powered or (self.baud is not None and self.baud != self.host_baud):
            return []
        answers: list[Answer] = []
        for payload, good in self._reader.feed(data):
            if not good:
                answers += self._send_bytes(NOT_UNDERSTOOD, now)
                continue
            baud = self.host_baud
            for part in self._execute_command(payload, now):
                answers += self._send_bytes(UNDERSTOOD + sick_telegram(part + bytes([self._status()]), ADDRESS), now)
            if baud != self.host_baud:
                # The answer is still sent at the old speed.
                self._reader = SickReader()
        return answers

    def due(self) -> float | None:
        """When the next scan goes out."""
        return self._next if self.scanning and self.powered else None

    def tick(self, now: float) -> list[Answer]:
        """A scan, if it is time for one."""
        if not self.scanning or not self.powered or now < self._next:
            return []
        period = 1 / RATES[self.host_baud]
        self._next = max(self._next + period, now + period / 2)
        return self._send_bytes(sick_telegram(self._scan(now), ADDRESS), now)

    def power_off(self, now: float, who: int | None = None) -> None:
        """Power off; the line speed is reset."""
        self.powered = self.scanning = False
        self.host_baud = 9600

    def power_on(self, now: float, who: int | None = None) -> None:
        """On again, at 9600."""
        self.powered = True

    def _execute_command(self, payload: bytes, now: float) -> list[bytes]:
        command = payload[:1]
        if payload == OPERATING_MODE + SEND_SCANS:
            self.scanning, self._next = True, now + 1 / RATES[self.host_baud]
        elif payload == OPERATING_MODE + SEND_ON_REQUEST:
            self.scanning = False
        elif command == OPERATING_MODE and len(payload) == 2 and payload[1] in BAUDS:
            self.host_baud = BAUDS[payload[1]]
        elif payload.startswith(OPERATING_MODE + CONFIGURE):
            return [MODE_REPLY + (b"\0" if payload[2:] == b"SICK_LMS" else b"\1")]
        elif command == SET_VARIANT and len(payload) == 5:
            return [self._variant(*struct.unpack("<HH", payload[1:]))]
        elif command == REQUEST_TYPE:
            return [TYPE_REPLY + TYPE_TEXT]
        elif command == REQUEST_STATUS:
            return [STATUS_REPLY + bytes(152)]
        elif payload == REQUEST_DATA + b"\x01":
            return [self._scan(now)[:-1]]
        elif command == RESET:
            self.power_off(now)
            self.power_on(now)
            return [RESET_REPLY + TYPE_TEXT]
        else:
            return [NOT_ACCEPTED]
        return [MODE_REPLY + b"\0"]

    def _variant(self, angle: int, resolution: int) -> bytes:
        good = angle in (100, 180) and resolution in RESOLUTIONS and not (angle == 180 and resolution == 25)
        if good:
            self.angle, self.resolution = angle, resolution
        return VARIANT_REPLY + struct.pack("<BHH", good, self.angle, self.resolution)

    def _scan(self, now: float) -> bytes:
        half = math.radians(self.angle / 2)
        with self.lock:
            self.body.advance(now)
            ranges = scan(self.body, -half, half, math.radians(self.resolution / 100), FARTHEST)
        raw = [NO_ECHO if metres >= FARTHEST else round(metres * 1000) for metres in ranges]
        data = DATA_REPLY + struct.pack("<H", len(raw) | 0x4000) + struct.pack(f"<{len(raw)}H", *raw)
        return data + bytes([self._status()])

    def _status(self) -> int:
        return STATUS | (0x80 if self.dirty else 0)

    def _send_bytes(self, data: bytes, now: float) -> list[Answer]:
        delay, data = self.faults.disturb(0, data)
        return [Answer(now + delay + len(data) * self.byte_time, data)] if data else []
