"""The driver of a Hokuyo laser with SCIP 2, on USB, on a serial line or on TCP (port 10940).

Values below the laser's smallest distance are codes of errors and count as no echo.  The readings are those of the
steps that are symmetric about the front.
"""

from __future__ import annotations

import math
from typing import Final

from urbihw.buses.errors import BadFrame
from urbihw.buses.link import Link
from urbihw.navigation.lasers import scip
from urbihw.navigation.lasers.driver import LaserDriver, LaserInfo, LaserScan, within

BAUD: Final = 115200
"""Bits per second; without effect on USB. A URG-04LX on its serial line starts with ``?baud=19200``."""
ANSWER_TIMEOUT_S: Final = 0.5


class ScipDriver(LaserDriver):
    """Reads the scans of a Hokuyo laser."""

    def __init__(self) -> None:
        super().__init__()
        self._framer = scip.ScipFramer()
        self._echo = ""
        self._count = 0
        self._range = (0.0, 0.0)

    def start(self, link: Link) -> LaserInfo:
        self.set_baud(link, BAUD)
        self._framer = scip.ScipFramer()
        if self._exchange(link, "QT") is None:
            # It may be in the mode of SCIP 1.1, whose answers have no sums.
            link.write(scip.command("SCIP2.0"))
            if self._exchange(link, "QT") is None:
                raise self.no_answer(link)
        try:
            found = scip.parse_parameters(self._ask(link, "PP"))
        except BadFrame as error:
            raise self.refuse(link, f"cannot be used: {error}") from error
        version = self._exchange(link, "VV")
        rows = scip.parse_rows(version) if version is not None else {}
        self._ask(link, "BM", scip.OK, scip.LASER_IS_ON)
        self._count = 2 * found.side + 1
        self._range = found.nearest / 1000, found.farthest / 1000
        self._echo = scip.scan_command(found.front - found.side, found.front + found.side)
        self._ask(link, self._echo)
        step = 2 * math.pi / found.turn
        return LaserInfo(
            2 * found.side * step, step, nearest=self._range[0],
            model=rows.get("PROD", ""), serial=rows.get("SERI", ""),
        )  # fmt: skip

    def stop(self, link: Link) -> None:
        link.write(scip.command("QT"))

    def take_bytes(self, data: bytes) -> LaserScan | None:
        scan = None
        for message in self._framer.feed(data):
            if not message.echo.startswith(self._echo[:12]):
                continue
            if message.status != scip.DATA:
                # The laser reports that it cannot measure now; silence ends it.
                self.unreadable += message.status != scip.OK
                continue
            try:
                values = scip.parse_distances(message, self._count)
            except BadFrame:
                self.unreadable += 1
                continue
            self.note_telegram()
            least, most = self._range
            scan = LaserScan(tuple(within(value / 1000, least, most) for value in values), most)
        self.damaged = self._framer.damaged
        return scan

    def _ask(self, link: Link, text: str, *good: str) -> scip.ScipMessage:
        message = self._exchange(link, text)
        if message is None or message.status not in (good or (scip.OK,)):
            how = "did not answer to" if message is None else f"answered {message.status} to"
            raise self.refuse(link, f"{how} {text}")
        return message

    def _exchange(self, link: Link, text: str) -> scip.ScipMessage | None:
        """Send a command and wait for its answer; scans that still arrive are skipped."""

        def take(data: bytes) -> scip.ScipMessage | None:
            return next((each for each in self._framer.feed(data) if each.echo == text), None)

        link.write(scip.command(text))
        found: scip.ScipMessage | None = self.read_until(link, ANSWER_TIMEOUT_S, take)
        return found
