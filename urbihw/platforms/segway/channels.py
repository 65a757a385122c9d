"""Two channels to one base: commands go to both, frames are taken from the second while the first is silent.

An RMP has two CAN buses, A and B, on which it sends the same frames; Player and CARMEN send their commands to both. A
channel that fails is opened again in a thread of its own, because some adapters take seconds to open.
"""

from __future__ import annotations

import math
import threading
from typing import Final

from urbihw.buses.can.frame import CanFrame
from urbihw.buses.errors import BadUrl, BusTimeout, LinkGone, Unavailable
from urbihw.buses.link import Port
from urbihw.platforms.segway import protocol as p
from urbihw.platforms.segway.line import RmpLine, line_over

TAKE_OVER_S: Final = 0.1
"""Silence of the first channel after which the second is used: ten cycles of the base."""
RETRY_S: Final = 1.0
"""Pause between two attempts to open a channel."""


class Channel:
    """One of the two: a port that may be closed for a while.

    Attributes:
        reason: why it does not work; "" while it does.
    """

    def __init__(self, port: Port) -> None:
        self.reason = ""
        self._port = port
        self._line: RmpLine | None = line_over(port) if port.is_open else None
        self._opening: threading.Thread | None = None
        self._retry_at = -math.inf
        self._is_over = False

    @property
    def is_open(self) -> bool:
        """Whether frames can be sent."""
        return self._line is not None

    @property
    def damaged(self) -> int:
        """The number of damaged frames since it was opened."""
        return self._line.damaged if self._line is not None else 0

    def send(self, frame: CanFrame) -> bool:
        """Send a frame; return False if the channel is closed. Raises BusTimeout."""
        if self._line is None:
            return False
        try:
            self._line.send(frame)
        except LinkGone as error:
            self._fail(str(error))
        return self._line is not None

    def receive(self) -> list[CanFrame]:
        """Return the frames received so far; none while the channel is closed."""
        if self._line is None:
            self._reopen()
        if self._line is None:
            return []
        try:
            return self._line.receive()
        except LinkGone as error:
            self._fail(str(error))
            return []

    def close(self) -> None:
        """Close the port for good."""
        self._is_over = True
        self._line = None
        self._port.close()

    def _fail(self, reason: str) -> None:
        self.reason = reason
        self._line = None
        self._port.close()
        self._retry_at = self._port.clock.now() + RETRY_S

    def _reopen(self) -> None:
        """Open the port in a thread; use it when that has worked."""
        if self._opening is not None:
            if self._opening.is_alive():
                return
            self._opening = None
            if self._port.is_open:
                self._line, self.reason = line_over(self._port), ""
                return
        if self._port.clock.now() >= self._retry_at:
            self._retry_at = self._port.clock.now() + RETRY_S
            self._opening = threading.Thread(target=self._open, name="second channel", daemon=True)
            self._opening.start()

    def _open(self) -> None:
        try:
            self._port.open()
        except (BadUrl, Unavailable) as error:
            self.reason = str(error)
        if self._is_over:
            self._port.close()


class DoubleLine:
    """Both channels as one line; it is gone when both are."""

    def __init__(self, first: Port, second: Port) -> None:
        self._channels = Channel(first), Channel(second)
        self._clock = first.clock
        self._heard_at = self._clock.now()
        self._told = ["", ""]
        self._uses_second = False

    def send(self, frame: CanFrame) -> None:
        """Send a frame on both channels. Raises LinkGone if both are closed, BusTimeout if none takes it."""
        full: BusTimeout | None = None
        sent = False
        for channel in self._channels:
            try:
                sent |= channel.send(frame)
            except BusTimeout as error:
                full = error
        if full is not None and not sent:
            raise full
        self._check_open()

    def receive(self) -> list[CanFrame]:
        """Return the frames of the first channel, or of the second while the first is silent. Raises LinkGone."""
        first, second = (channel.receive() for channel in self._channels)
        self._check_open()
        now = self._clock.now()
        if any(frame.id != p.COMMAND for frame in first):
            self._heard_at = now
        self._uses_second = now - self._heard_at > TAKE_OVER_S
        return second if self._uses_second else first

    @property
    def damaged(self) -> int:
        """The number of damaged frames on both channels."""
        return sum(channel.damaged for channel in self._channels)

    def pop_news(self) -> list[str]:
        """Return what has changed since the last call, one line for each channel."""
        first, second = self._channels
        silent = "it is silent" if self._uses_second and first.is_open else first.reason
        states = silent, second.reason
        news = [
            f"the {word} channel does not work: {state}" if state else f"the {word} channel works again"
            for word, state, told in zip(("first", "second"), states, self._told, strict=True)
            if bool(state) != bool(told)
        ]
        self._told = list(states)
        return news

    def close(self) -> None:
        """Close both channels for good."""
        for channel in self._channels:
            channel.close()

    def _check_open(self) -> None:
        if not any(channel.is_open for channel in self._channels):
            raise LinkGone(f"both channels are gone: {self._channels[0].reason}")
