"""Frames, and what everything on a CAN bus is: it hears frames, it sends some, at times of its own or when asked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple


class CanFrame(NamedTuple):
    """A frame with an identifier of 11 bits and at most 8 data bytes; others do not exist for the fakes."""

    id: int
    data: bytes

    def __str__(self) -> str:
        return f"{self.id:03X}#{self.data.hex().upper()}"


class Timed(NamedTuple):
    """A frame, and the second at which it is on the bus."""

    at: float
    frame: CanFrame


class CanNode(ABC):
    """A node on a bus. It has no clock: the serving loop passes the time."""

    @abstractmethod
    def receive_frame(self, frame: CanFrame, now: float) -> list[Timed]:
        """Receive a frame of another node; return the answers."""

    @abstractmethod
    def tick(self, now: float) -> list[Timed]:
        """Advance to `now` and return the unsolicited frames until then, in order of time."""

    @abstractmethod
    def due(self) -> float | None:
        """Return when the next `tick` is due; None for never."""

    def power_off(self, now: float) -> None:
        """Switch the node off: it is silent from now on."""
        raise NotImplementedError(f"{type(self).__name__} has no power switch")

    def power_on(self, now: float) -> None:
        """Switch it on again."""
        raise NotImplementedError(f"{type(self).__name__} has no power switch")
