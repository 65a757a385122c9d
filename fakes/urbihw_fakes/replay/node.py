"""Recorded traffic of a CAN bus, as a node: each piece is a frame, two bytes of identifier and the data."""

from __future__ import annotations

from urbihw_fakes.can.node import CanFrame, CanNode, Timed
from urbihw_fakes.device import Answer
from urbihw_fakes.replay.device import Replay


class ReplayNode(CanNode):
    """All that was on the recorded bus besides the host; `replay` has the answers."""

    def __init__(self, replay: Replay) -> None:
        self.replay = replay

    def receive_frame(self, frame: CanFrame, now: float) -> list[Timed]:
        """Answer a frame of the host."""
        return _frames(self.replay.receive(frame.id.to_bytes(2, "big") + frame.data, now))

    def tick(self, now: float) -> list[Timed]:
        """Return the frames that come before the first one of the host."""
        return _frames(self.replay.tick(now))

    def due(self) -> float | None:
        """Return when the next `tick` is due."""
        return self.replay.due()

    def power_off(self, now: float) -> None:
        """Be silent until `power_on`."""
        self.replay.power_off(now)

    def power_on(self, now: float) -> None:
        """Answer requests again from now on."""
        self.replay.power_on(now)


def _frames(answers: list[Answer]) -> list[Timed]:
    return [Timed(each.at, CanFrame(int.from_bytes(each.data[:2], "big"), each.data[2:])) for each in answers]
