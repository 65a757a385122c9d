"""canopen over a CAN port, without a receiving thread.

canopen normally receives in a thread, and its calls wait for the messages of that thread. Here the wait itself
receives, so that everything happens in the one thread of a worker, on its clock.
"""

from __future__ import annotations

import queue
from typing import Any

import canopen

from urbihw.buses.can.frame import CanFrame
from urbihw.buses.can.port import CanPort, silence_logger

_MOST_FRAMES = 1000


class PortNetwork(canopen.Network):
    """A network on an open port.

    Attributes:
        damaged: number of malformed messages, such as too short ones.
    """

    def __init__(self, port: CanPort) -> None:
        super().__init__()
        silence_logger("canopen")
        self.damaged = 0
        self._port = port

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        """Send a message. Raises BusTimeout, LinkGone."""
        self._port.send(CanFrame(can_id, bytes(data)))

    def receive(self, deadline: float = 0.0) -> int:
        """Process received messages, waiting for one until `deadline`; return their number. Raises LinkGone."""
        frames = self._port.receive(_MOST_FRAMES, deadline)
        now = self._port.clock.now()
        for frame in frames:
            try:
                self.notify(frame.id, bytearray(frame.data), now)
            except Exception:
                # No content of a message may end the worker; canopen checks little.
                self.damaged += 1
        return len(frames)

    def receive_for(self, seconds: float) -> None:
        """Receive for a number of seconds."""
        end = self._port.clock.now() + seconds
        while self._port.clock.now() < end:
            self.receive(end)

    def add_remote_node(self, number: int, dictionary: canopen.ObjectDictionary) -> Any:
        """Add a node to talk to; a `canopen.RemoteNode`."""
        node: Any = self.add_node(number, dictionary)
        node.sdo.responses = _SdoResponses(self, self._port)
        return node


class _SdoResponses(queue.SimpleQueue[bytes]):
    """Queue of the answers of an SDO server; waiting for one receives from the port."""

    def __init__(self, network: PortNetwork, port: CanPort) -> None:
        super().__init__()
        self._network = network
        self._port = port

    def empty(self) -> bool:
        """Discard late answers to an earlier request, and return True."""
        while not super().empty():
            super().get(block=False)
        return True

    def get(self, block: bool = True, timeout: float | None = None) -> bytes:
        """The next answer. Raises queue.Empty, LinkGone."""
        end = self._port.clock.now() + (timeout or 0.0)
        while super().empty() and self._port.clock.now() < end:
            self._network.receive(end)
        return super().get(block=False)
