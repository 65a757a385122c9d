"""A SICK LMS111 on TCP: 541 readings over 270 degrees, 25 scans a second, CoLa A and CoLa B.

It answers in the dialect in which it was asked; a real one speaks one of them on each of its ports.  Source: SICK,
"Telegram Listing LiDAR sensors LMS1xx, LMS5xx, TiM2xx ...", 8014631 (2020).
"""

from __future__ import annotations

import math
import struct
import threading

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.lasers.rays import Carrier, distances

PERIOD_S = 0.04
FIRST, STEP, COUNT = -45.0, 0.5, 541
FARTHEST = 20.0
WAKING_S = 0.7
"""Seconds from LMCstartmeas to the first scan (a real one needs longer)."""
NAME, VERSION = b"LMS10x_FieldEval", b"V1.36-21.10.2010"


class ColaLaser(Device):
    """The laser of ``body``; ``lock`` is held during every access to the body.

    Attributes:
        powered: it has power; standby: it measures only after LMCstartmeas; dirty: its window is polluted.
        speaks: the dialects that it understands, of "A" and "B".
        first, step, count: the first angle and the step in degrees, and the number of readings; they may change at any
            time, as with SOPAS.
    """

    model = "lms1xx"
    """``laser_model`` in the settings."""

    def __init__(self, body: Carrier, lock: threading.RLock | None = None, *, speaks: str = "AB") -> None:
        super().__init__()
        self.body = body
        self.lock = lock if lock is not None else threading.RLock()
        self.powered = True
        self.standby = self.dirty = False
        self.speaks = speaks
        self.first, self.step, self.count = FIRST, STEP, COUNT
        self._binary = False
        self._subscribed = self._logged_in = False
        self._heard = b""
        self._next = 0.0
        self._ready = 0.0
        self._sent = 0

    @property
    def scanning(self) -> bool:
        """Whether it sends scans."""
        return self._subscribed and not self.standby

    def receive(self, data: bytes, now: float) -> list[Answer]:
        if not self.powered:
            return []
        self._heard += data
        answers: list[Answer] = []
        while (taken := self._take()) is not None:
            content, binary = taken
            if ("B" if binary else "A") in self.speaks:
                self._binary = binary
                answers += self._send(self._frame(self._execute(content, now)), now)
        return answers

    def due(self) -> float | None:
        """When the next scan goes out."""
        return self._next if self.scanning and self.powered else None

    def tick(self, now: float) -> list[Answer]:
        """A scan, if it is time for one."""
        if not self.scanning or not self.powered or now < self._next:
            return []
        self._next = max(self._next + PERIOD_S, now + PERIOD_S / 2)
        self._sent += 1
        return self._send(self._frame(self._scan(now)), now)

    def power_off(self, now: float, who: int | None = None) -> None:
        self.powered = self._subscribed = self._logged_in = False

    def power_on(self, now: float, who: int | None = None) -> None:
        self.powered = True

    def _take(self) -> tuple[bytes, bool] | None:
        """The next telegram, and whether it was binary."""
        start = self._heard.find(b"\x02")
        self._heard = self._heard[start:] if start >= 0 else b""
        if self._heard.startswith(b"\x02\x02\x02\x02"):
            size = int.from_bytes(self._heard[4:8], "big")
            if len(self._heard) < 9 + size:
                return None
            content, self._heard = self._heard[8 : 8 + size], self._heard[9 + size :]
            return content, True
        end = self._heard.find(b"\x03")
        if end < 0:
            return None
        content, self._heard = self._heard[1:end], self._heard[end + 1 :]
        return content, False

    def _execute(self, content: bytes, now: float) -> bytes:
        kind, _, rest = content.partition(b" ")
        name, _, data = rest.partition(b" ")
        yes = b"\x01" if self._binary else b"1"
        if (kind, name) == (b"sRN", b"DeviceIdent"):
            texts = (NAME, VERSION)
            if self._binary:
                return b"sRA DeviceIdent " + b"".join(struct.pack(">H", len(text)) + text for text in texts)
            return b"sRA DeviceIdent " + b" ".join(b"%X %s" % (len(text), text) for text in texts)
        if (kind, name) == (b"sRN", b"LMDscandata") and not self.standby and now >= self._ready:
            return self._scan(now, b"sRA")
        if (kind, name) == (b"sEN", b"LMDscandata"):
            self._subscribed, self._next = data == yes, now + PERIOD_S
            return b"sEA LMDscandata " + data
        if (kind, name) == (b"sMN", b"SetAccessMode"):
            self._logged_in = data in (b"03 F4724744", b"\x03\xf4\x72\x47\x44")
            return b"sAN SetAccessMode " + (yes if self._logged_in else b"\0" if self._binary else b"0")
        if (kind, name) == (b"sMN", b"LMCstartmeas") and self._logged_in:
            self.standby, self._ready = False, now + WAKING_S
            return b"sAN LMCstartmeas " + (b"\0" if self._binary else b"0")
        if (kind, name) == (b"sMN", b"Run"):
            self._logged_in = False
            return b"sAN Run " + yes
        return b"sFA " + (b"\0\x03" if self._binary else b"3")

    def _scan(self, now: float, kind: bytes = b"sSN") -> bytes:
        angles = [math.radians(self.first + index * self.step - 90) for index in range(self.count)]
        with self.lock:
            self.body.advance(now)
            seen = distances(self.body, angles, FARTHEST)
        raw = [round(metres * 1000) if metres < FARTHEST else 0 for metres in seen]
        stamp = int(now * 1e6) % 2**32
        head = [(1, 2), (1, 2), (0x895E9C, 4), (0, 1), (2 * self.dirty, 1), (self._sent % 65536, 2),
                (self._sent % 65536, 2), (stamp, 4), (stamp, 4), (0, 1), (0, 1), (7, 1), (0, 1), (0, 2), (2500, 4),
                (360, 4), (0, 2), (1, 2)]  # fmt: skip
        scale = struct.unpack(">I", struct.pack(">f", 1.0))[0]
        first, step = round(self.first * 10000) % 2**32, round(self.step * 10000)
        channel = [(scale, 4), (0, 4), (first, 4), (step, 2), (self.count, 2), *((value, 2) for value in raw)]
        tail = [(0, 2)] * 6
        return kind + b" LMDscandata " + self._numbers(head) + self._join(b"DIST1", channel) + self._numbers(tail)

    def _join(self, word: bytes, numbers: list[tuple[int, int]]) -> bytes:
        return word + self._numbers(numbers) if self._binary else b" " + word + b" " + self._numbers(numbers) + b" "

    def _numbers(self, numbers: list[tuple[int, int]]) -> bytes:
        if self._binary:
            return b"".join(value.to_bytes(size, "big") for value, size in numbers)
        return b" ".join(b"%X" % value for value, _ in numbers)

    def _frame(self, content: bytes) -> bytes:
        if not self._binary:
            return b"\x02" + content + b"\x03"
        check = 0
        for byte in content:
            check ^= byte
        return b"\x02\x02\x02\x02" + len(content).to_bytes(4, "big") + content + bytes((check,))

    def _send(self, data: bytes, now: float) -> list[Answer]:
        delay, data = self.faults.disturb(0, data)
        return [Answer(now + delay + len(data) * self.byte_time, data)] if data else []
