"""What every fake robot is: bytes and a time go in, timed answers come out.

A device knows no clock, no socket and no thread. Whoever serves it (`urbihw_fakes.endpoint`) says what time it is, in
seconds on any steady scale, and delivers each answer when its time has come.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass
from typing import Literal, NamedTuple

from urbihw_fakes.faults import Faults

BITS_PER_BYTE = 10  # 8 data bits, no parity, a start and a stop bit


@dataclass(frozen=True, slots=True)
class Answer:
    """Bytes from the device; `at` is the second at which the last of them has left the wire."""

    at: float
    data: bytes


class Traffic(NamedTuple):
    """One line of the log: `way` is `>` for host to device and `<` for device to host."""

    at: float
    way: Literal[">", "<"]
    data: bytes

    def __str__(self) -> str:
        return f"[{self.at:.6f}] {self.way} {self.data.hex(' ').upper()}"


class Device(ABC):
    """Base of the fake robots.

    A robot must define `receive`. It may define `tick` (state that moves on by itself), `due` (when it next speaks
    without being asked) and `power_off` / `power_on`.

    Attributes:
        faults: what is wrong at the moment; see `urbihw_fakes.faults`.
        log: the last `log_size` pieces of traffic, oldest first.
        baud: bits per second that the adapter talks at present; None means "whatever the units listen to".
        byte_time: seconds one byte takes on the wire; 0 answers at once, with no return delay either (see `pace`).
    """

    def __init__(self, *, log_size: int = 1000) -> None:
        self.faults = Faults()
        self.log: deque[Traffic] = deque(maxlen=log_size)
        self.baud: int | None = None
        self.byte_time = 0.0

    def pace(self, baud: int) -> None:
        """Let traffic take the time it takes at `baud` bits per second (1 or more)."""
        self.byte_time = BITS_PER_BYTE / baud

    def feed(self, data: bytes, now: float) -> list[Answer]:
        """Hand over bytes of the host, the last of which arrived at `now`; return what the device sends back."""
        self.log.append(Traffic(now, ">", data))
        answers = self.receive(data, now)
        if self.faults.echo:
            # A one-wire adapter hears itself: the echo comes while the host is still sending, so before any answer.
            answers.insert(0, Answer(now, data))
        for answer in answers:
            self.log.append(Traffic(answer.at, "<", answer.data))
        return answers

    @abstractmethod
    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Take bytes of the host and return the answers, in order of time."""

    def tick(self, now: float) -> list[Answer]:
        """Bring the state to `now` and return what the device says unasked; nothing for most."""
        return []

    def due(self) -> float | None:
        """When the device next wants a `tick` to speak unasked; None when it never does."""
        return None

    def power_off(self, now: float, who: int | None = None) -> None:
        """Cut the power of unit `who`, or of everything: it falls limp, forgets its RAM and hears nothing."""
        raise NotImplementedError(f"{type(self).__name__} has no power switch")

    def power_on(self, now: float, who: int | None = None) -> None:
        """Give the power back: registers start from their power-on values."""
        raise NotImplementedError(f"{type(self).__name__} has no power switch")
