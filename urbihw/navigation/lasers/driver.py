"""What the drivers of all lasers have in the worker: a base of ``urbihw.buses.driver`` families.

The device "laser" has the items ``ranges`` (m, right to left, inf where nothing was measured), ``farthest`` (m) and
``dirty`` (polluted window).  It has no targets and no requests, and it moves nothing.
"""

from __future__ import annotations

import errno
import math
from collections.abc import Callable
from typing import Any, ClassVar, Final

from urbihw.buses.driver import Driver, no_stop
from urbihw.buses.errors import BadValue, LinkGone, Unavailable
from urbihw.buses.link import Link, Port, byte_link, set_line_speed
from urbihw.buses.messages import Configure, Found, FromWorker, Request, Samples
from urbihw.frozen import frozen

LASER: Final = "laser"
CHUNK: Final = 65536
"""Bytes read in one tick at most."""


@frozen
class LaserInfo:
    """The laser that was found.

    Attributes:
        field: angle in rad between the first reading and the last one, symmetric about ``middle``.
        resolution: angle in rad between two readings.
        middle: direction of the middle of the field, rad to the left of the laser's front.
        nearest: smallest distance in m that it measures.
        model, serial: as it tells them, "" if it does not.
    """

    field: float
    resolution: float
    middle: float = 0.0
    nearest: float = 0.02
    model: str = ""
    serial: str = ""


@frozen
class LaserScan:
    """One scan: distances in m from right to left (counterclockwise), inf without an echo.

    Attributes:
        farthest: greatest distance in m that the laser can tell.
        dirty: its window is polluted.
        info: the laser with other angles, if they have changed since the scan before; else None.
    """

    ranges: tuple[float, ...]
    farthest: float
    dirty: bool = False
    info: LaserInfo | None = None


class LaserDriver(Driver):
    """Base of the drivers: a subclass implements ``start``, ``stop`` and ``take_bytes``.

    Attributes:
        silence: seconds without a readable scan after which the laser counts as lost.
        damaged, unreadable: telegrams with a wrong check sum, and valid ones with a content that makes no sense.
    """

    can_move = False
    silence: ClassVar[float] = 3.0

    def __init__(self) -> None:
        self._link: Link | None = None
        self._heard_at = 0.0
        self._heard = False
        self.damaged = self.unreadable = 0

    # ---------------------------------------------------------------- hooks

    def start(self, link: Link) -> LaserInfo:
        """Find the laser and let it scan.  Raises Unavailable, BadUrl, LinkGone."""
        raise NotImplementedError

    def stop(self, link: Link) -> None:
        """Let it end its scans, without waiting for an answer.  Raises LinkGone."""
        raise NotImplementedError

    def take_bytes(self, data: bytes) -> LaserScan | None:
        """Process received bytes; return the last scan that is complete now.  Call ``note_telegram`` for each scan.

        Damage is counted, never raised.
        """
        raise NotImplementedError

    # ---------------------------------------------------------------- what a subclass calls

    def note_telegram(self) -> None:
        """A scan, or a part of one, has come and could be read: the laser is alive."""
        self._heard = True

    @staticmethod
    def set_baud(link: Link, default: int) -> None:
        """Set the speed of a serial line: that of the url, or the one that the laser has by default."""
        set_line_speed(link, link.baud if "baud" in link.url.options else default)

    @staticmethod
    def refuse(link: Link, problem: str, number: int = errno.EPROTO) -> Unavailable:
        """Return the error for a laser that cannot be used."""
        return Unavailable(number, f"the laser on {link.url.text} {problem}")

    @staticmethod
    def no_answer(link: Link) -> Unavailable:
        """Return the error for a line on which no laser answers."""
        text = f"no laser answers on {link.url.text}: has it power, is this its port, its speed and its laser_model?"
        return Unavailable(errno.ETIMEDOUT, text)

    @staticmethod
    def read_until(link: Link, timeout: float, take: Callable[[bytes], Any]) -> Any:
        """Read for ``timeout`` seconds until ``take`` returns something for what came; None if it never did."""
        deadline = link.clock.now() + timeout
        while link.clock.now() < deadline:
            found = take(link.read(4096, deadline))
            if found is not None:
                return found
        return None

    # ---------------------------------------------------------------- the driver

    def configure(self, settings: Configure) -> None:
        """The laser has no settings."""

    def attach(self, port: Port) -> list[FromWorker]:
        """Wake the laser and start the scans.  Raises Unavailable, BadUrl, LinkGone."""
        link = byte_link(port)
        self.damaged = self.unreadable = 0
        info = self.start(link)
        self._link = link
        self._heard_at = link.clock.now()
        return [Found((info,))]

    def detach(self) -> None:
        """Forget the link, which is lost."""
        self._link = None

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop) -> list[FromWorker]:
        """Process the received bytes; of several scans the last is used.  Raises LinkGone."""
        link = self._link
        if link is None:
            return []
        self._heard = False
        data = link.read(CHUNK, now)
        scan = self.take_bytes(data) if data else None
        if self._heard:
            self._heard_at = now
        elif now - self._heard_at > self.silence:
            raise LinkGone(f"{link.url.text}: the laser has sent no scan for {self.silence:g} s; has it power?")
        if scan is None:
            return []
        values = {"ranges": scan.ranges, "farthest": scan.farthest, "dirty": scan.dirty}
        changed = [Found((scan.info,))] if scan.info is not None else []
        return [*changed, Samples(now, {LASER: values}, {LASER: now})]

    def set_target(self, device: Any, item: str, value: Any) -> None:
        """Refuse targets: a laser has none."""
        raise BadValue("a laser takes no targets")

    def execute_request(self, message: Request) -> list[FromWorker]:
        """Refuse requests: a laser has none."""
        raise BadValue(f"a laser knows no request {message.verb}")

    def stop_on_reconnect(self) -> tuple[Any, ...]:
        """Do nothing: a laser that is back goes on scanning."""
        return ()

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """False: a laser moves nothing."""
        return False

    def request_moves(self, request: Request) -> bool:
        """False: a laser moves nothing."""
        return False

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Stop the scans.  Raises LinkGone."""
        if self._link is not None:
            self.stop(self._link)

    def errors(self) -> dict[str, int]:
        """The numbers of damaged telegrams, and of intact ones with invalid content."""
        return {"damaged": self.damaged, "unreadable": self.unreadable}


def within(value: float, least: float, most: float) -> float:
    """Return a distance, or inf if it is not from ``least`` to ``most``."""
    return value if least <= value <= most else math.inf
