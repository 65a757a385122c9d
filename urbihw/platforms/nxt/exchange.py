"""One telegram in flight: requests and their replies over a link, whatever carries them.

USB keeps packets apart; a serial line (Bluetooth) is a stream, and each telegram has its length in front.  A reply that
comes too late would be taken for that to the next request, so what is left over is thrown away after each failure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from urbihw.buses.errors import BadFrame, BusTimeout, LinkGone
from urbihw.buses.link import Link
from urbihw.platforms.nxt.protocol import LONGEST

PATIENCE: Final = {True: 0.3, False: 1.5}
"""Seconds to wait for a reply, on links that keep packets and on others.

A brick answers within a pass of its main loop of about 1 ms; Bluetooth takes some 30 ms to turn round, and stalls."""
LATE: Final = 0.06
"""Seconds after which a reply is late: twice what Bluetooth takes to turn round."""
STRIKES: Final = 3
"""Requests in a row without a reply after which the brick counts as gone."""
_MOST_LEFT_OVER = 32  # reads
_HEAD = 2
_BLUETOOTH_BUFFER = 128


@dataclass
class Counters:
    """Failures since the link was opened."""

    timeouts: int = 0
    damaged: int = 0
    refused: int = 0


class Exchange:
    """Requests over one link.  ``begin`` and ``poll`` do not wait for longer than they are told; ``ask`` does both."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.patience = PATIENCE[link.packets]
        self.counters = Counters()
        self._opcode = -1
        self._give_up_at = 0.0
        self._buffer = b""
        self._left_over = True
        self._strikes = 0

    @property
    def busy(self) -> bool:
        """Whether a reply is awaited."""
        return self._opcode >= 0

    @property
    def late(self) -> bool:
        """Whether the reply that is awaited should have been there long ago."""
        return self.busy and self.link.clock.now() >= self._give_up_at - self.patience + LATE

    def tell(self, telegram: bytes) -> None:
        """Send a telegram that wants no reply.  Raises LinkGone."""
        self.link.write(self._framed(telegram))

    def begin(self, telegram: bytes) -> None:
        """Send a telegram that wants a reply; one that was awaited is given up.  Raises LinkGone."""
        if self._left_over or self.busy:
            self._drain()
        self._opcode = telegram[1]
        self._give_up_at = self.link.clock.now() + self.patience
        self.link.write(self._framed(telegram))

    def poll(self, until: float) -> bytes | None:
        """The reply, or None if it is not there at ``until``.

        Raises BusTimeout when it has been waited for long enough, BadFrame when what came makes no sense, and LinkGone,
        also after several failures in a row: then the brick is switched off, or hangs.
        """
        while True:
            try:
                reply = self._receive(min(until, self._give_up_at))
            except BadFrame:
                self.counters.damaged += 1
                self._fail()
                raise
            if reply is None:
                break
            if len(reply) >= 3 and reply[0] == 0x02 and reply[1] == self._opcode:
                self._opcode = -1
                self._strikes = 0
                return reply
            # An old reply, or noise: the one we want may still come.
            self.counters.damaged += 1
        if self.link.clock.now() < self._give_up_at:
            return None
        self.counters.timeouts += 1
        self._fail()
        raise BusTimeout(f"no answer from the brick in {self.patience:g} s")

    def ask(self, telegram: bytes) -> bytes:
        """The reply to a telegram.  Raises what ``poll`` raises."""
        self.begin(telegram)
        reply = self.poll(self._give_up_at)
        if reply is None:
            raise BusTimeout(f"no answer from the brick in {self.patience:g} s")
        return reply

    def _drain(self) -> None:
        """Throw away what has come, but not for ever: something that babbles must not hold us."""
        self._buffer = b""
        self._left_over = False
        for _ in range(_MOST_LEFT_OVER):
            if not self.link.read(4096, self.link.clock.now()):
                return

    def _fail(self) -> None:
        self._opcode = -1
        self._left_over = True
        self._strikes += 1
        if self._strikes >= STRIKES:
            raise LinkGone(f"{self.link.url.text}: the brick does not answer any more; is it switched off?")

    def _framed(self, telegram: bytes) -> bytes:
        return telegram if self.link.packets else len(telegram).to_bytes(_HEAD, "little") + telegram

    def _receive(self, until: float) -> bytes | None:
        """The next telegram, or None."""
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
