"""The driver of a SICK LMS200: starts at 9600 baud and is set to the baud rate of the url (default 38400).

Its units are not changed: every scan contains its unit.  Sources: ARIA (``ArLMS2xx.cpp``), the maker's telegram
listing: a telegram that was understood is acknowledged by one byte within 60 ms, its answer may take seconds.
"""

from __future__ import annotations

import errno
import math
from typing import Final

from urbihw.buses.errors import BadFrame, Unavailable
from urbihw.buses.link import Link, has_line_speed, set_line_speed
from urbihw.navigation.lasers import lms200
from urbihw.navigation.lasers.driver import LaserDriver, LaserInfo, LaserScan

WORKING_BAUD, WAKING_BAUD = 38400, 9600
FIELD, RESOLUTION = 180, 100
"""Degrees, and hundredths of a degree: 181 readings, as the manual says."""
ACK_TIMEOUT_S, MODE_TIMEOUT_S = 0.15, 3.0
"""Seconds to wait for a sign that the laser understands this speed, and for the answer to a change of mode."""
PORT_PAUSE: Final = 0.02


class SickDriver(LaserDriver):
    """Reads the scans of a SICK LMS2xx."""

    def __init__(self) -> None:
        super().__init__()
        self._framer = lms200.SickFramer()

    def start(self, link: Link) -> LaserInfo:
        self._framer = lms200.SickFramer()
        self._reach(link)
        reply = self._ask(link, lms200.variant(FIELD, RESOLUTION), lms200.VARIANT_REPLY)
        if len(reply.data) != 5 or not reply.data[0]:
            raise self.refuse(link, f"does not take {FIELD} degrees")
        self._ask(link, lms200.START, lms200.MODE_REPLY)
        field, resolution = reply.data[1] | reply.data[2] << 8, reply.data[3] | reply.data[4] << 8
        return LaserInfo(math.radians(field), math.radians(resolution / 100))

    def stop(self, link: Link) -> None:
        link.write(lms200.telegram(lms200.STOP))

    def take_bytes(self, data: bytes) -> LaserScan | None:
        scan = None
        for reply in self._framer.feed(data):
            if reply.kind == lms200.SCAN:
                try:
                    scan = lms200.parse_scan(reply)
                except BadFrame:
                    self.unreadable += 1
                else:
                    self.note_telegram()
        self.damaged = self._framer.damaged
        return scan

    def _reach(self, link: Link) -> None:
        """Find the laser at its last baud rate or at that of its start, then set the working one."""
        serial = has_line_speed(link)
        baud = link.baud if "baud" in link.url.options or not serial else WORKING_BAUD
        if serial and baud not in lms200.BAUD_CODES:
            speeds = ", ".join(map(str, lms200.BAUD_CODES))
            raise Unavailable(errno.EINVAL, f"{link.url.text}: a laser has no {baud} baud, but {speeds}")
        set_line_speed(link, baud)
        if self._exchange(link, lms200.STOP, lms200.MODE_REPLY) is not None:
            return
        if serial and baud != WAKING_BAUD:
            set_line_speed(link, WAKING_BAUD)
            if self._exchange(link, lms200.baud(baud), lms200.MODE_REPLY) is not None:
                link.clock.sleep_until(link.clock.now() + PORT_PAUSE)
                set_line_speed(link, baud)
                if self._exchange(link, lms200.STOP, lms200.MODE_REPLY) is not None:
                    return
        raise self.no_answer(link)

    def _ask(self, link: Link, payload: bytes, kind: int) -> lms200.SickReply:
        reply = self._exchange(link, payload, kind)
        if reply is None or reply.kind == lms200.REFUSED:
            how = "did not answer to" if reply is None else "refused"
            raise self.refuse(link, f"{how} {payload.hex(' ').upper()}")
        return reply

    def _exchange(self, link: Link, payload: bytes, kind: int) -> lms200.SickReply | None:
        """Send a telegram and wait for its answer; scans that still arrive are skipped.

        Without an acknowledgement or a telegram within ACK_TIMEOUT_S the laser does not listen at this speed.
        """
        self._framer.reset()
        link.write(lms200.telegram(payload))
        started = link.clock.now()
        deadline = started + ACK_TIMEOUT_S
        understood = False
        while link.clock.now() < deadline:
            data = link.read(4096, deadline)
            replies = self._framer.feed(data)
            if data and not understood:
                # The bytes that the laser was sending when it was asked come first.
                deadline = started + ACK_TIMEOUT_S + lms200.LONGEST * link.byte_time
            if not understood and (replies or data.startswith(lms200.ACK)):
                understood = True
                deadline = started + MODE_TIMEOUT_S
            for reply in replies:
                if reply.kind in (kind, lms200.REFUSED):
                    return reply
        return None
