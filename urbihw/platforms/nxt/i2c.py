"""Sensors on the I2C bus of a port: a measurement takes several telegrams, spread over ticks.

Rules of the brick (firmware: c_lowspeed.c; nxt-python, issue 35): the first use is 100 ms after the type was set; what
an earlier transfer left is read and dropped first, for it would come before the next answer; between the write and the
first look at the status a fast host has to wait for some 10 ms; after an error one simply starts again.
"""

from __future__ import annotations

from typing import Final

from urbihw.buses.errors import BadFrame, BusTimeout
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt.exchange import Exchange

ULTRASONIC: Final = 0x02
DISTANCE: Final = 0x42
NO_ECHO: Final = 255
_TRANSFER = 0.012  # s until it is worth looking
_LOOK_AGAIN = 0.003
_LOOKS = 30
_REST = 0.05  # s after a failure
_NOT_SET_UP = 0.02


class Ultrasonic:
    """The steps of measuring a distance over and over.

    ``due`` is when ``telegram()`` is to be sent; ``take`` is handed the reply and gives a distance in cm when there is
    one: 255 for no echo and when the sensor cannot be read.
    """

    def __init__(self, port: int, now: float) -> None:
        self._port = port
        self._step = "flush"
        self._looks = 0
        self._began = now
        self.due = now

    def telegram(self, now: float) -> bytes:
        """What to send now."""
        if self._step == "write":
            self._began = now
            return p.ls_write(self._port, bytes((ULTRASONIC, DISTANCE)), 1)
        if self._step == "look":
            return p.ls_status(self._port)
        return p.ls_read(self._port)

    def take(self, reply: bytes, now: float, period: float) -> int | None:
        """The reply to the last telegram.  Raises nothing: a bad reply is a measurement that failed."""
        step = self._step
        try:
            if step == "flush":
                self._go_on("write", now)
                return None
            if step == "write":
                p.body(reply, 0)
                self._looks = 0
                self._go_on("look", now + _TRANSFER)
                return None
            if step == "look":
                return self._looked(p.parse_ls_status(reply), now)
            data = p.parse_ls_read(reply)
            self._go_on("write", max(self._began + period, now + 0.01))
            return data[-1] if data else self.failed(now)
        except p.Refused as error:
            if step == "look" and error.code == p.PENDING:
                return self._looked(0, now)
            if step == "write" and error.code == p.NOT_READY:
                self._go_on("flush", now + _NOT_SET_UP)
                return None
            return self.failed(now)
        except BadFrame:
            return self.failed(now)

    def failed(self, now: float) -> int:
        """The measurement failed; the next one begins anew."""
        self._go_on("flush", now + _REST)
        return NO_ECHO

    def _looked(self, ready: int, now: float) -> int | None:
        if ready:
            self._go_on("read", now)
            return None
        self._looks += 1
        if self._looks >= _LOOKS:
            return self.failed(now)
        self._go_on("look", now + _LOOK_AGAIN)
        return None

    def _go_on(self, step: str, due: float) -> None:
        self._step, self.due = step, due


def transfer(exchange: Exchange, port: int, data: bytes, count: int) -> bytes:
    """One transfer with any sensor, waited for: up to some 50 ms.  Raises BusError for what goes wrong."""
    clock = exchange.link.clock
    exchange.ask(p.ls_read(port))
    p.body(exchange.ask(p.ls_write(port, data, count)), 0)
    for _ in range(_LOOKS):
        clock.sleep_until(clock.now() + _LOOK_AGAIN)
        try:
            ready = p.parse_ls_status(exchange.ask(p.ls_status(port)))
        except p.Refused as error:
            if error.code != p.PENDING:
                raise
            continue
        if ready >= count:
            # What a failed transfer left over comes first.
            return p.parse_ls_read(exchange.ask(p.ls_read(port)))[-count:] if count else b""
    raise BusTimeout(f"the sensor on port {port + 1} does not answer")
