"""Requests and replies over a link of any kind, with one telegram in flight.

USB keeps packets apart; a serial line (Bluetooth) is a stream, and each telegram has its length in front.  A late reply
would be mistaken for the reply to the next request, so stale bytes are discarded after each failure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from urbihw.buses.errors import BadFrame, BusTimeout, LinkGone
from urbihw.buses.link import Link
from urbihw.platforms.nxt.protocol import LONGEST

RESPONSE_TIMEOUT_S: Final = {True: 0.3, False: 1.5}
"""Seconds to wait for a reply, on links that keep packets and on others.

A brick answers within a pass of its main loop, about 1 ms; Bluetooth takes some 30 ms to turn round, and may stall."""
LATE_AFTER_S: Final = 0.06
"""Seconds after which a reply is late: twice the turn-round time of Bluetooth."""
MAX_MISSED_REPLIES: Final = 3
"""Consecutive requests without a reply after which the brick counts as gone."""
_MAX_STALE_READS = 32  # reads
_HEAD = 2
_BLUETOOTH_BUFFER = 128


@dataclass
class NxtCounters:
    """Failures since the link was opened."""

    timeouts: int = 0
    damaged: int = 0
    refused: int = 0


class NxtExchange:
    """Requests over one link; ``request`` is ``send_request`` and ``poll_reply`` until the time-out."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.timeout_s = RESPONSE_TIMEOUT_S[link.packets]
        self.counters = NxtCounters()
        self._opcode = -1
        self._deadline = 0.0
        self._buffer = b""
        self._has_stale_bytes = True
        self._missed_replies = 0

    @property
    def is_busy(self) -> bool:
        """Whether a reply is awaited."""
        return self._opcode >= 0

    @property
    def is_late(self) -> bool:
        """Whether the awaited reply is overdue."""
        return self.is_busy and self.link.clock.now() >= self._deadline - self.timeout_s + LATE_AFTER_S

    def send(self, telegram: bytes) -> None:
        """Send a telegram that requests no reply.  Raises LinkGone."""
        self.link.write(self._framed(telegram))

    def send_request(self, telegram: bytes) -> None:
        """Send a telegram that requests a reply, and give up an earlier one.  Raises LinkGone."""
        if self._has_stale_bytes or self.is_busy:
            self._drain()
        self._opcode = telegram[1]
        self._deadline = self.link.clock.now() + self.timeout_s
        self.link.write(self._framed(telegram))

    def poll_reply(self, until: float) -> bytes | None:
        """Return the reply, or None if it has not arrived at ``until``.

        Raises BusTimeout after the time-out, BadFrame for an invalid reply, and LinkGone, also after
        MAX_MISSED_REPLIES failures: the brick is then switched off, or hangs.
        """
        while True:
            try:
                reply = self._receive(min(until, self._deadline))
            except BadFrame:
                self.counters.damaged += 1
                self._fail()
                raise
            if reply is None:
                break
            if len(reply) >= 3 and reply[0] == 0x02 and reply[1] == self._opcode:
                self._opcode = -1
                self._missed_replies = 0
                return reply
            # An old reply, or noise: the awaited one may still arrive.
            self.counters.damaged += 1
        if self.link.clock.now() < self._deadline:
            return None
        self.counters.timeouts += 1
        self._fail()
        raise BusTimeout(f"no answer from the brick in {self.timeout_s:g} s")

    def request(self, telegram: bytes) -> bytes:
        """Send a telegram and return its reply.  Raises as ``poll_reply``."""
        self.send_request(telegram)
        reply = self.poll_reply(self._deadline)
        if reply is None:
            raise BusTimeout(f"no answer from the brick in {self.timeout_s:g} s")
        return reply

    def _drain(self) -> None:
        """Discard stale bytes, with a limited number of reads: an endless sender must not block the tick."""
        self._buffer = b""
        self._has_stale_bytes = False
        for _ in range(_MAX_STALE_READS):
            if not self.link.read(4096, self.link.clock.now()):
                return

    def _fail(self) -> None:
        self._opcode = -1
        self._has_stale_bytes = True
        self._missed_replies += 1
        if self._missed_replies >= MAX_MISSED_REPLIES:
            raise LinkGone(f"{self.link.url.text}: the brick does not answer any more; is it switched off?")

    def _framed(self, telegram: bytes) -> bytes:
        return telegram if self.link.packets else len(telegram).to_bytes(_HEAD, "little") + telegram

    def _receive(self, until: float) -> bytes | None:
        """Return the next telegram, or None at ``until``."""
        if self.link.packets:
            return self.link.read(LONGEST, until) or None
        while True:
            length = int.from_bytes(self._buffer[:_HEAD], "little") if len(self._buffer) >= _HEAD else None
            if length is not None and not 0 < length <= _BLUETOOTH_BUFFER:
                raise BadFrame(f"no telegram is {length} bytes long: bytes were lost on the way")
            if length is not None and len(self._buffer) >= _HEAD + length:
                reply, self._buffer = self._buffer[_HEAD : _HEAD + length], self._buffer[_HEAD + length :]
                return reply
            data = self.link.read(_HEAD + _BLUETOOTH_BUFFER, until)
            if not data:
                return None
            self._buffer += data
