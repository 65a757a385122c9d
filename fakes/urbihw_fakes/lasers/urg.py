"""A Hokuyo URG-04LX on USB: SCIP 2, 682 steps over 240 degrees, ten scans a second.

Source: Hokuyo, "Communication Protocol Specification For SCIP2.0 Standard", C-42-03320B (2006).
"""

from __future__ import annotations

import math
import threading

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.lasers.rays import Carrier, distances

STEPS, FIRST, LAST, FRONT = 1024, 44, 725, 384
NEAREST_MM, FARTHEST_MM = 20, 5600
PERIOD_S = 0.1
LONGEST_COMMAND = 64
LINE = 64
"""Characters of a line of data."""


class Urg(Device):
    """The laser of ``body``; ``lock`` is held during every access to the body.

    Attributes:
        powered: it has power; lit: its laser is on; old: it starts in the mode of SCIP 1.1.
    """

    model = "urg"
    """``laser_model`` in the settings."""

    def __init__(self, body: Carrier, lock: threading.RLock | None = None, *, old: bool = False) -> None:
        super().__init__()
        self.body = body
        self.lock = lock if lock is not None else threading.RLock()
        self.powered = True
        self.lit = False
        self.old = old
        self._heard = b""
        self._wanted = ""
        self._next = 0.0

    @property
    def scanning(self) -> bool:
        """Whether it sends scans."""
        return bool(self._wanted)

    def receive(self, data: bytes, now: float) -> list[Answer]:
        if not self.powered:
            return []
        *lines, self._heard = (self._heard + data).replace(b"\r", b"\n").split(b"\n")
        self._heard = self._heard[-LONGEST_COMMAND:]
        answers: list[Answer] = []
        for line in lines:
            if line:
                answers += self._send(self._execute(line.decode("latin-1"), now), now)
        return answers

    def due(self) -> float | None:
        """When the next scan goes out."""
        return self._next if self._wanted and self.powered else None

    def tick(self, now: float) -> list[Answer]:
        """A scan, if it is time for one."""
        if not self._wanted or not self.powered or now < self._next:
            return []
        self._next = max(self._next + PERIOD_S, now + PERIOD_S / 2)
        lines = [_encode(int(now * 1000) % 2**24, 4), *self._scan(now)]
        # The last digits of the echo count the scans down that are left; 00 from the beginning is without end.
        left = int(self._wanted[13:15])
        echo = f"{self._wanted[:13]}{max(0, left - 1):02d}{self._wanted[15:]}"
        self._wanted = "" if left == 1 else echo
        return self._send(_reply(echo, "99", lines), now)

    def power_off(self, now: float, who: int | None = None) -> None:
        self.powered = self.lit = False
        self._wanted = ""

    def power_on(self, now: float, who: int | None = None) -> None:
        self.powered = True

    def _execute(self, command: str, now: float) -> bytes:
        if self.old:
            self.old = command != "SCIP2.0"
            return b"SCIP2.0\n0\n\n" if not self.old else f"{command}\nE\n\n".encode("latin-1")
        name = command[:2]
        if command == "SCIP2.0":
            return _reply(command, "0E")
        if name in ("QT", "RS"):
            self._wanted, self.lit = "", False
            return _reply(command, "00")
        if name == "BM":
            status, self.lit = "02" if self.lit else "00", True
            return _reply(command, status)
        if name == "TM":
            times = [_encode(int(now * 1000) % 2**24, 4)] if command == "TM1" else []
            return _reply(command, "00", times)
        if command == "%ST":
            # The newer models (hokuyolx) know: standing by, or scanning.
            return _reply(command, "00", [b"004" if self._wanted else b"000"])
        if name in ("PP", "VV"):
            return _reply(command, "00", _rows(name), semicolon=True)
        if name == "MD":
            return _reply(command, self._begin(command, now))
        return _reply(command, "0E")

    def _begin(self, command: str, now: float) -> str:
        digits = command[2:15]
        if len(digits) != 13 or not digits.isdigit():
            return "0C"
        first, last = int(digits[:4]), int(digits[4:8])
        if not FIRST <= first <= last <= LAST:
            return "04"
        self._wanted, self.lit, self._next = command, True, now + PERIOD_S
        return "00"

    def _scan(self, now: float) -> list[bytes]:
        first, last = int(self._wanted[2:6]), int(self._wanted[6:10])
        angles = [(step - FRONT) * 2 * math.pi / STEPS for step in range(first, last + 1)]
        with self.lock:
            self.body.advance(now)
            seen = distances(self.body, angles, FARTHEST_MM / 1000)
        # 0 is the code for "no echo".
        values = [round(metres * 1000) if metres < FARTHEST_MM / 1000 else 0 for metres in seen]
        data = b"".join(_encode(value, 3) for value in values)
        return [data[at : at + LINE] for at in range(0, len(data), LINE)]

    def _send(self, data: bytes, now: float) -> list[Answer]:
        delay, data = self.faults.disturb(0, data)
        return [Answer(now + delay + len(data) * self.byte_time, data)] if data else []


def _rows(name: str) -> list[bytes]:
    if name == "VV":
        rows = {"VEND": "Hokuyo Automatic Co.,Ltd.", "PROD": "SOKUIKI Sensor URG-04LX", "FIRM": "3.4.03",
                "PROT": "SCIP 2.0", "SERI": "H0000001"}  # fmt: skip
    else:
        rows = {"MODL": "URG-04LX(Hokuyo Automatic Co.,Ltd.)", "DMIN": str(NEAREST_MM), "DMAX": str(FARTHEST_MM),
                "ARES": str(STEPS), "AMIN": str(FIRST), "AMAX": str(LAST), "AFRT": str(FRONT),
                "SCAN": "600"}  # fmt: skip
    return [f"{key}:{value}".encode("ascii") for key, value in rows.items()]


def _reply(echo: str, status: str, lines: list[bytes] | None = None, *, semicolon: bool = False) -> bytes:
    data = echo.encode("latin-1") + b"\n" + _summed(status.encode("ascii"))
    for line in lines or []:
        data += _summed(line, b";" if semicolon else b"")
    return data + b"\n"


def _summed(line: bytes, mark: bytes = b"") -> bytes:
    return line + mark + bytes((sum(line) % 64 + 48,)) + b"\n"


def _encode(value: int, characters: int) -> bytes:
    return bytes((value >> 6 * place & 63) + 48 for place in reversed(range(characters)))
