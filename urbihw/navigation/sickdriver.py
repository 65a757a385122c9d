"""The driver of a SICK LMS200: a family for ``urbihw.buses.driver``.

The device "laser" has the items ``ranges`` (m, right to left, inf where nothing was measured), ``unit`` (m per count)
and ``dirty`` (polluted window).  It has no targets.  The laser starts at 9600 baud and is set to the baud rate of the
url (default 38400).  Its units are not changed: every scan contains its unit. Sources: ARIA (``ArLMS2xx.cpp``), the
maker's telegram listing.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from urbihw.buses.driver import Driver, no_stop
from urbihw.buses.errors import BadFrame, LinkGone, Unavailable
from urbihw.buses.link import Link, Port, byte_link, has_line_speed, set_line_speed
from urbihw.buses.messages import Configure, Found, FromWorker, Refused, Reply, Request, Samples, Targets, Watch
from urbihw.navigation import sick

LASER: Final = "laser"
WORKING_BAUD, WAKING_BAUD = 38400, 9600
FIELD, RESOLUTION = 180, 100
"""Degrees, and hundredths of a degree: 181 readings, as the manual says."""
ANSWER_TIMEOUT_S, MODE_TIMEOUT_S = 0.6, 3.0
"""Seconds to wait for an answer, and for the answer to a change of mode."""
SILENCE_TIMEOUT_S: Final = 3.0
"""Seconds without a telegram after which the laser counts as lost; a scan takes 0.4 s at 9600 baud."""
PORT_PAUSE: Final = 0.02


@dataclass(frozen=True, slots=True)
class LaserInfo:
    """The laser that was found: field of view in degrees, resolution in hundredths of a degree."""

    field: int
    resolution: int


class SickDriver(Driver):
    """Reads the scans of a SICK laser in a worker; the head of this file tells how."""

    def __init__(self) -> None:
        self._link: Link | None = None
        self._framer = sick.Framer()
        self._heard_at = 0.0
        self._unreadable = 0

    def configure(self, settings: Configure) -> None:
        """The laser has no settings."""

    def attach(self, port: Port) -> list[FromWorker]:
        """Wake the laser and start the scans.  Raises Unavailable, BadUrl, LinkGone."""
        link = byte_link(port)
        self._framer = sick.Framer()
        self._unreadable = 0
        self._reach(link)
        reply = self._ask(link, sick.variant(FIELD, RESOLUTION), sick.VARIANT_REPLY, MODE_TIMEOUT_S)
        if len(reply.data) != 5 or not reply.data[0]:
            raise Unavailable(errno.EPROTO, f"the laser on {link.url.text} does not take {FIELD} degrees")
        self._ask(link, sick.START, sick.MODE_REPLY, MODE_TIMEOUT_S)
        self._link = link
        self._heard_at = link.clock.now()
        field, resolution = reply.data[1] | reply.data[2] << 8, reply.data[3] | reply.data[4] << 8
        return [Found((LaserInfo(field, resolution),))]

    def _reach(self, link: Link) -> None:
        """Find the laser at its last baud rate or at that of its start, then set the working one."""
        serial = has_line_speed(link)
        baud = link.baud if "baud" in link.url.options or not serial else WORKING_BAUD
        if serial and baud not in sick.BAUD_CODES:
            raise Unavailable(
                errno.EINVAL, f"{link.url.text}: a laser has no {baud} baud, but {', '.join(map(str, sick.BAUD_CODES))}"
            )
        set_line_speed(link, baud)
        if self._answers(link, sick.STOP):
            return
        if serial and baud != WAKING_BAUD:
            set_line_speed(link, WAKING_BAUD)
            if self._answers(link, sick.baud(baud)):
                link.clock.sleep_until(link.clock.now() + PORT_PAUSE)
                set_line_speed(link, baud)
                if self._answers(link, sick.STOP):
                    return
        raise Unavailable(
            errno.ETIMEDOUT, f"no laser answers on {link.url.text}: has it power, is this its port and its speed?"
        )

    def _answers(self, link: Link, payload: bytes) -> bool:
        return self._exchange(link, payload, sick.MODE_REPLY, ANSWER_TIMEOUT_S) is not None

    def _ask(self, link: Link, payload: bytes, kind: int, timeout: float) -> sick.Reply:
        reply = self._exchange(link, payload, kind, timeout)
        if reply is None or reply.kind == sick.REFUSED:
            how = "did not answer to" if reply is None else "refused"
            raise Unavailable(errno.EPROTO, f"the laser on {link.url.text} {how} {payload.hex(' ').upper()}")
        return reply

    def _exchange(self, link: Link, payload: bytes, kind: int, timeout: float) -> sick.Reply | None:
        """Send a telegram and wait for its answer; scans that still arrive are skipped."""
        self._framer.reset()
        link.write(sick.telegram(payload))
        deadline = link.clock.now() + timeout
        while link.clock.now() < deadline:
            for reply in self._framer.feed(link.read(4096, deadline)):
                if reply.kind in (kind, sick.REFUSED):
                    return reply
        return None

    def detach(self) -> None:
        """Forget the link, which is lost."""
        self._link = None

    def tick(
        self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop
    ) -> list[FromWorker]:
        """Process the received bytes; of several scans the last is used.  Raises LinkGone."""
        link = self._link
        if link is None:
            return []
        data = link.read(65536, now)
        if not data:
            if now - self._heard_at > SILENCE_TIMEOUT_S:
                raise LinkGone(f"{link.url.text}: the laser has been silent for {SILENCE_TIMEOUT_S:g} s; has it power?")
            return []
        scan: sick.Scan | None = None
        for reply in self._framer.feed(data):
            self._heard_at = now
            if reply.kind == sick.SCAN:
                try:
                    scan = sick.parse_scan(reply)
                except BadFrame:
                    self._unreadable += 1
        if scan is None:
            return []
        return [Samples(now, {LASER: {"ranges": scan.ranges, "unit": scan.unit, "dirty": scan.dirty}}, {LASER: now})]

    def targets(self, message: Targets) -> list[FromWorker]:
        """Ignore targets: a laser has none."""
        return [Refused(device, item, "a laser takes no targets") for device, item in message.values]

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Do nothing: the laser sends its scans unasked."""
        return []

    def request(self, message: Request) -> list[FromWorker]:
        """Ignore requests: a laser has none."""
        return [Reply(message.reply_id, False, error=f"a laser knows no request {message.verb}")]

    def stop_on_reconnect(self) -> None:
        """Do nothing: a laser that is back goes on scanning."""

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """False: a laser moves nothing."""
        return False

    def request_moves(self, request: Request) -> bool:
        """False: a laser moves nothing."""
        return False

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Stop the scans.  Raises LinkGone."""
        if self._link is not None:
            self._link.write(sick.telegram(sick.STOP))

    def errors(self) -> dict[str, int]:
        """The numbers of damaged telegrams, and of intact ones with invalid content."""
        return {"damaged": self._framer.damaged, "unreadable": self._unreadable}
