"""The driver of a SICK LMS1xx or TiM, on TCP (port 2111 or 2112) or on a serial line; it speaks CoLa B or CoLa A.

The laser's own settings (resolution, sector, filters) are left as they are: each scan tells its angles.  Its front is
at 90 degrees of its own count.
"""

from __future__ import annotations

import math
from typing import Final

from urbihw.buses.errors import BadFrame
from urbihw.buses.link import Link
from urbihw.navigation.lasers import cola
from urbihw.navigation.lasers.driver import LaserDriver, LaserInfo, LaserScan

BAUD: Final = 57600
ANSWER_TIMEOUT_S: Final = 0.5
START_TIMEOUT_S: Final = 5.0
"""Seconds to wait for the first scan of a laser that was just told to measure."""
FRONT: Final = 90.0
LARGEST: Final = 0xFFFF


class ColaDriver(LaserDriver):
    """Reads the scans of a SICK laser with CoLa."""

    def __init__(self) -> None:
        super().__init__()
        self._framer = cola.ColaFramer()
        self._binary = False
        self._info = LaserInfo(0.0, 0.0)

    def start(self, link: Link) -> LaserInfo:
        self.set_baud(link, BAUD)
        self._framer = cola.ColaFramer()
        name = self._find_dialect(link)
        scan = self._ask_scan(link) or self._wake(link)
        self._ask(link, "sEN", "LMDscandata 1", "sEA")
        self._info = _info_of(scan, name)
        return self._info

    def stop(self, link: Link) -> None:
        link.write(cola.telegram("sEN", "LMDscandata 0", binary=self._binary))

    def take_bytes(self, data: bytes) -> LaserScan | None:
        scan = self._last_scan(data)
        if scan is None:
            return None
        least = cola.FIRST_VALID
        ranges = tuple(raw * scan.unit if raw >= least else math.inf for raw in scan.raw)
        # Somebody may change the sector or the resolution while the laser scans.
        before, self._info = self._info, _info_of(scan, self._info.model)
        return LaserScan(ranges, LARGEST * scan.unit, scan.dirty, self._info if self._info != before else None)

    def _last_scan(self, data: bytes) -> cola.Distances | None:
        found = None
        for message in self._framer.feed(data):
            if message.name == "LMDscandata" and message.kind in ("sSN", "sRA"):
                try:
                    found = cola.parse_scan(message)
                except BadFrame:
                    self.unreadable += 1
                else:
                    self.note_telegram()
        self.damaged = self._framer.damaged
        return found

    def _ask_scan(self, link: Link) -> cola.Distances | None:
        """Ask for one scan; None if there is none."""
        answer = self._exchange(link, "sRN", "LMDscandata", "sRA")
        if answer is None:
            return None
        try:
            return cola.parse_scan(answer)
        except BadFrame:
            return None

    def _wake(self, link: Link) -> cola.Distances:
        """Log in, let a laser that stands by measure, and leave its configuration; return its first scan."""
        for text in (cola.LOGIN, "LMCstartmeas", "Run"):
            self._ask(link, "sMN", text, "sAN")
        deadline = link.clock.now() + START_TIMEOUT_S
        while link.clock.now() < deadline:
            scan = self._ask_scan(link)
            if scan is not None:
                return scan
        raise self.refuse(link, "answers, but it measures nothing")

    def _find_dialect(self, link: Link) -> str:
        """Ask for the name of the device in both dialects; keep the one in which it answers."""
        for binary in (True, False):
            self._binary = binary
            answer = self._exchange(link, "sRN", "DeviceIdent", "sRA")
            if answer is not None:
                self._binary = answer.binary
                return cola.parse_name(answer)
        raise self.no_answer(link)

    def _ask(self, link: Link, kind: str, text: str, answer: str) -> cola.Telegram:
        message = self._exchange(link, kind, text, answer)
        if message is None:
            raise self.refuse(link, f"did not answer to {kind} {text.partition(' ')[0]}")
        return message

    def _exchange(self, link: Link, kind: str, text: str, answer: str) -> cola.Telegram | None:
        """Send a telegram and wait for its answer; scans that still arrive are skipped."""
        name = text.partition(" ")[0]

        def take(data: bytes) -> cola.Telegram | None:
            messages = self._framer.feed(data)
            return next((each for each in messages if each.kind == answer and each.name == name), None)

        link.write(cola.telegram(kind, text, binary=self._binary))
        found: cola.Telegram | None = self.read_until(link, ANSWER_TIMEOUT_S, take)
        return found


def _info_of(scan: cola.Distances, name: str) -> LaserInfo:
    """The laser with the angles of a scan."""
    field = scan.step * (len(scan.raw) - 1)
    middle = math.radians(scan.first + field / 2 - FRONT)
    return LaserInfo(math.radians(field), math.radians(scan.step), middle, 0.05, name)
