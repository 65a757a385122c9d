"""A CAN bus in memory, for tests: `can://pipe/name` passes frames over the pipe of that name, in simulated time.

A frame is a record as Linux lays it out (`struct can_frame`): identifier in 4 bytes of the machine's order, length, 3
bytes of nothing, 8 bytes of data.
"""

from __future__ import annotations

import struct

import can

from urbihw.buses.can.frame import MOST_DATA
from urbihw.buses.link import Context, Url
from urbihw.buses.pipe import PipeLink

_RECORD = struct.Struct("=IB3x8s")
_FAST = 100_000_000


class PipeBus:
    """The part of python-can's bus interface that a port uses. Raises Unavailable."""

    def __init__(self, name: str, context: Context) -> None:
        # A pipe simulates the time of serial bytes; the high speed makes it negligible.
        self._link = PipeLink(Url.parse(f"pipe://{name}?baud={_FAST}"), context)
        self._link.open()
        self._rest = b""

    def send(self, message: can.Message) -> None:
        """Send a frame. Raises LinkGone."""
        self._link.write(_RECORD.pack(message.arbitration_id, len(message.data), bytes(message.data)))

    def recv(self, timeout: float) -> can.Message | None:
        """The next frame, if one comes in time. Raises LinkGone."""
        clock = self._link.clock
        end = clock.now() + timeout
        while True:
            self._rest += self._link.read(_RECORD.size - len(self._rest), end)
            if len(self._rest) == _RECORD.size:
                break
            if clock.now() >= end:
                return None
        (identifier, length, data), self._rest = _RECORD.unpack(self._rest), b""
        return can.Message(arbitration_id=identifier, data=data[: min(length, MOST_DATA)], is_extended_id=False)

    def shutdown(self) -> None:
        self._link.close()
