"""A CAN bus behind a wire of bytes: the adapter that stands between them is a codec.

    device = CanDevice(SegwayRmp(), Slcan())
    with PtyEndpoint(device) as end: ...
"""

from __future__ import annotations

from typing import Protocol

from urbihw_fakes.can.node import CanFrame, CanNode, Timed
from urbihw_fakes.device import Answer, Device

THE_NODE = 1
"""The number of the one node on the bus, for `urbihw_fakes.faults`."""


class Codec(Protocol):
    """The codec of an adapter: frames to bytes and back, and the adapter's own answers."""

    def decode(self, data: bytes) -> tuple[list[CanFrame], bytes]:
        """Decode bytes of the host: the frames in them, and the adapter's answers."""

    def encode(self, frame: CanFrame) -> bytes:
        """Encode a frame of the bus as bytes for the host; b"" when the adapter suppresses it."""


class CanDevice(Device):
    """One node, its bus and an adapter."""

    def __init__(self, node: CanNode, codec: Codec, *, log_size: int = 1000) -> None:
        super().__init__(log_size=log_size)
        self.node = node
        self.codec = codec

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Pass the frames in `data` on to the node."""
        frames, reply = self.codec.decode(data)
        answers = [Answer(now, reply)] if reply else []
        for frame in frames:
            answers += self._answers(self.node.receive_frame(frame, now))
        return answers

    def tick(self, now: float) -> list[Answer]:
        """Return the node's unsolicited frames as bytes."""
        return self._answers(self.node.tick(now))

    def due(self) -> float | None:
        """Return when the node's next `tick` is due."""
        return self.node.due()

    def power_off(self, now: float, who: int | None = None) -> None:
        """Switch the node off."""
        self.node.power_off(now)

    def power_on(self, now: float, who: int | None = None) -> None:
        """Switch the device on; it begins as after a reset."""
        self.node.power_on(now)

    def _answers(self, sent: list[Timed]) -> list[Answer]:
        answers = []
        for at, frame in sent:
            delay, data = self.faults.disturb(THE_NODE, self.codec.encode(frame))
            if data:
                answers.append(Answer(at + delay, data))
        return answers
