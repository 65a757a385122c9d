"""Sensors on the I2C bus of a port: a measurement takes several telegrams, spread over ticks.

Rules of the brick (firmware: c_lowspeed.c; nxt-python, issue 35): the first transfer is possible 100 ms after the type
was set; bytes left from an earlier transfer are read and dropped first, because they precede the next answer; a fast
host waits some 10 ms between the write and the first status request; after an error the measurement starts again.
"""

from __future__ import annotations

from typing import Final

from urbihw.buses.errors import BadFrame, BusTimeout
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt.exchange import NxtExchange

ULTRASONIC: Final = 0x02
DISTANCE: Final = 0x42
NO_ECHO: Final = 255
_TRANSFER = 0.012  # s between two status requests
_STATUS_PERIOD = 0.003
_MAX_STATUS_REQUESTS = 30
_REST = 0.05  # s of pause after a failure
_NOT_SET_UP = 0.02


class Ultrasonic:
    """The steps of a repeated distance measurement.

    ``due`` is the time to send ``telegram()``.  ``parse_reply`` gets the reply and returns the distance in cm after the
    last step: 255 without an echo, or if the sensor cannot be read.
    """

    def __init__(self, port: int, now: float) -> None:
        self._port = port
        self._step = "flush"
        self._status_requests = 0
        self._began = now
        self.due = now

    def telegram(self, now: float) -> bytes:
        """Return the telegram of the present step."""
        if self._step == "write":
            self._began = now
            return p.ls_write(self._port, bytes((ULTRASONIC, DISTANCE)), 1)
        if self._step == "status":
            return p.ls_status(self._port)
        return p.ls_read(self._port)

    def parse_reply(self, reply: bytes, now: float, period: float) -> int | None:
        """Process the reply to the last telegram.  A bad reply raises nothing: the measurement has failed."""
        step = self._step
        try:
            if step == "flush":
                self._set_step("write", now)
                return None
            if step == "write":
                p.body(reply, 0)
                self._status_requests = 0
                self._set_step("status", now + _TRANSFER)
                return None
            if step == "status":
                return self._handle_status(p.parse_ls_status(reply), now)
            data = p.parse_ls_read(reply)
            self._set_step("write", max(self._began + period, now + 0.01))
            return data[-1] if data else self.failed(now)
        except p.BrickRefused as error:
            if step == "status" and error.code == p.PENDING:
                return self._handle_status(0, now)
            if step == "write" and error.code == p.NOT_READY:
                self._set_step("flush", now + _NOT_SET_UP)
                return None
            return self.failed(now)
        except BadFrame:
            return self.failed(now)

    def failed(self, now: float) -> int:
        """End a failed measurement; the next one starts with the first step."""
        self._set_step("flush", now + _REST)
        return NO_ECHO

    def _handle_status(self, ready: int, now: float) -> int | None:
        if ready:
            self._set_step("read", now)
            return None
        self._status_requests += 1
        if self._status_requests >= _MAX_STATUS_REQUESTS:
            return self.failed(now)
        self._set_step("status", now + _STATUS_PERIOD)
        return None

    def _set_step(self, step: str, due: float) -> None:
        self._step, self.due = step, due


def transfer(exchange: NxtExchange, port: int, data: bytes, count: int) -> bytes:
    """Execute one transfer with any sensor; blocks for up to some 50 ms.  Raises BusError."""
    clock = exchange.link.clock
    exchange.request(p.ls_read(port))
    p.body(exchange.request(p.ls_write(port, data, count)), 0)
    for _ in range(_MAX_STATUS_REQUESTS):
        clock.sleep_until(clock.now() + _STATUS_PERIOD)
        try:
            ready = p.parse_ls_status(exchange.request(p.ls_status(port)))
        except p.BrickRefused as error:
            if error.code != p.PENDING:
                raise
            continue
        if ready >= count:
            # Bytes left from a failed transfer come first.
            return p.parse_ls_read(exchange.request(p.ls_read(port)))[-count:] if count else b""
    raise BusTimeout(f"the sensor on port {port + 1} does not answer")
