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
    """Something on a bus. It knows no clock: whoever serves it says what time it is."""

    @abstractmethod
    def hear(self, frame: CanFrame, now: float) -> list[Timed]:
        """Take a frame of somebody else and return what is sent in answer."""

    @abstractmethod
    def tick(self, now: float) -> list[Timed]:
        """Bring the state to `now` and return what was sent unasked until then, in order of time."""

    @abstractmethod
    def due(self) -> float | None:
        """When the node next wants a `tick`; None when it never does."""

    def power_off(self, now: float) -> None:
        """Cut its power."""
        raise NotImplementedError(f"{type(self).__name__} has no power switch")

    def power_on(self, now: float) -> None:
        """Give the power back."""
        raise NotImplementedError(f"{type(self).__name__} has no power switch")
