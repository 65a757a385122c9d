"""What drives the wire of a SICK LMS200: a family for ``urbihw.buses.driver``.

The device "laser" has the items ``ranges`` (m, right to left, inf where nothing was measured), ``unit`` (m per count)
and ``dirty`` (polluted window).  It takes no targets.  The laser wakes up at 9600 baud and is brought to the speed of
the url (38400 if that says none).  Its units are left as they are: every scan says in which it counts.
Sources: ARIA (``ArLMS2xx.cpp``), the maker's telegram listing.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from urbihw.buses.driver import Driver, never
from urbihw.buses.errors import BadFrame, LinkGone, Unavailable
from urbihw.buses.link import Link, Port, byte_link, has_line_speed, set_line_speed
from urbihw.buses.messages import Configure, Found, FromWorker, Refused, Reply, Request, Samples, Targets, Watch
from urbihw.navigation import sick

LASER: Final = "laser"
WORKING_BAUD, WAKING_BAUD = 38400, 9600
FIELD, RESOLUTION = 180, 100
"""Degrees, and hundredths of a degree: 181 readings, as the manual says."""
ANSWER, MODE_ANSWER = 0.6, 3.0
"""Seconds to wait for an answer, and for that to a change of mode."""
SILENCE: Final = 3.0
"""Seconds without a telegram after which the laser counts as lost; a scan takes 0.4 s at 9600 baud."""
PORT_PAUSE: Final = 0.02


@dataclass(frozen=True, slots=True)
class LaserInfo:
    """A laser as found: its field of view in degrees, its resolution in hundredths of a degree."""

    field: int
    resolution: int


class SickDriver(Driver):
    """See the head of this file, and ``urbihw.buses.driver.Driver``."""

    def __init__(self) -> None:
        self._link: Link | None = None
        self._framer = sick.Framer()
        self._heard_at = 0.0
        self._unreadable = 0

    def configure(self, settings: Configure) -> None:
        """There is nothing to set."""

    def attach(self, port: Port) -> list[FromWorker]:
        """Wake the laser and let it scan.  Raises Unavailable, BadUrl, LinkGone."""
        link = byte_link(port)
        self._framer = sick.Framer()
        self._unreadable = 0
        self._reach(link)
        reply = self._ask(link, sick.variant(FIELD, RESOLUTION), sick.VARIANT_REPLY, MODE_ANSWER)
        if len(reply.data) != 5 or not reply.data[0]:
            raise Unavailable(errno.EPROTO, f"the laser on {link.url.text} does not take {FIELD} degrees")
        self._ask(link, sick.START, sick.MODE_REPLY, MODE_ANSWER)
        self._link = link
        self._heard_at = link.clock.now()
        field, resolution = reply.data[1] | reply.data[2] << 8, reply.data[3] | reply.data[4] << 8
        return [Found((LaserInfo(field, resolution),))]

    def _reach(self, link: Link) -> None:
        """Find the laser at the speed it was left at, or at that of its waking; then at ours."""
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
        return self._exchange(link, payload, sick.MODE_REPLY, ANSWER) is not None

    def _ask(self, link: Link, payload: bytes, kind: int, timeout: float) -> sick.Reply:
        reply = self._exchange(link, payload, kind, timeout)
        if reply is None or reply.kind == sick.REFUSED:
            how = "did not answer to" if reply is None else "refused"
            raise Unavailable(errno.EPROTO, f"the laser on {link.url.text} {how} {payload.hex(' ').upper()}")
        return reply

    def _exchange(self, link: Link, payload: bytes, kind: int, timeout: float) -> sick.Reply | None:
        """Send a telegram and wait for its answer; scans that still come are passed over."""
        self._framer.reset()
        link.write(sick.telegram(payload))
        deadline = link.clock.now() + timeout
        while link.clock.now() < deadline:
            for reply in self._framer.feed(link.read(4096, deadline)):
                if reply.kind in (kind, sick.REFUSED):
                    return reply
        return None

    def detach(self) -> None:
        """The link is gone."""
        self._link = None

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = never) -> list[FromWorker]:
        """Take in what has come; of several scans the last.  Raises LinkGone."""
        link = self._link
        if link is None:
            return []
        data = link.read(65536, now)
        if not data:
            if now - self._heard_at > SILENCE:
                raise LinkGone(f"{link.url.text}: the laser has been silent for {SILENCE:g} s; has it power?")
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
        """A laser takes none."""
        return [Refused(device, item, "a laser takes no targets") for device, item in message.values]

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Scans come by themselves."""
        return []

    def request(self, message: Request) -> list[FromWorker]:
        """A laser takes none."""
        return [Reply(message.reply_id, False, error=f"a laser knows no request {message.verb}")]

    def rest(self) -> None:
        """A laser that is back scans on."""

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """Nothing here moves."""
        return False

    def request_moves(self, request: Request) -> bool:
        """Nothing here moves."""
        return False

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Let the laser rest.  Raises LinkGone."""
        if self._link is not None:
            self._link.write(sick.telegram(sick.STOP))

    def errors(self) -> dict[str, int]:
        """Telegrams that were damaged on the way, and good ones that made no sense."""
        return {"damaged": self._framer.damaged, "unreadable": self._unreadable}
