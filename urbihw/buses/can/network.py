"""canopen over a CAN port, without a thread: messages are taken when somebody waits for one or looks.

canopen's own way is a thread that receives; its calls then wait for what that thread brings. Here the wait itself
receives, so that everything happens in the one thread of a worker and on its clock.
"""

from __future__ import annotations

import queue
from typing import Any

import canopen

from urbihw.buses.can.frame import Frame
from urbihw.buses.can.port import CanPort, keep_quiet

_MOST_FRAMES = 1000


class PortNetwork(canopen.Network):
    """A network on an open port.

    Attributes:
        damaged: messages that made no sense, such as too short ones.
    """

    def __init__(self, port: CanPort) -> None:
        super().__init__()
        keep_quiet("canopen")
        self.damaged = 0
        self._port = port

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        """Send a message. Raises BusTimeout, LinkGone."""
        self._port.send(Frame(can_id, bytes(data)))

    def receive(self, deadline: float = 0.0) -> int:
        """Take what has come, or wait for a message until `deadline`; how many there were. Raises LinkGone."""
        frames = self._port.receive(_MOST_FRAMES, deadline)
        now = self._port.clock.now()
        for frame in frames:
            try:
                self.notify(frame.id, bytearray(frame.data), now)
            except Exception:
                # Whatever stands in a message, it must not end the worker; canopen checks little.
                self.damaged += 1
        return len(frames)

    def wait(self, seconds: float) -> None:
        """Receive for so long."""
        end = self._port.clock.now() + seconds
        while self._port.clock.now() < end:
            self.receive(end)

    def node(self, number: int, dictionary: canopen.ObjectDictionary) -> Any:
        """Add a node to talk to; a `canopen.RemoteNode`."""
        node: Any = self.add_node(number, dictionary)
        node.sdo.responses = _Answers(self, self._port)
        return node


class _Answers(queue.SimpleQueue[bytes]):
    """Answers of an SDO server; waiting for one receives."""

    def __init__(self, network: PortNetwork, port: CanPort) -> None:
        super().__init__()
        self._network = network
        self._port = port

    def empty(self) -> bool:
        """Whether nothing waits: late answers to an earlier question are thrown away, and then nothing does."""
        while not super().empty():
            super().get(block=False)
        return True

    def get(self, block: bool = True, timeout: float | None = None) -> bytes:
        """The next answer. Raises queue.Empty, LinkGone."""
        end = self._port.clock.now() + (timeout or 0.0)
        while super().empty() and self._port.clock.now() < end:
            self._network.receive(end)
        return super().get(block=False)
