"""The base of all fake robots: bytes and a time in, timed answers out.

A device knows no clock, no socket and no thread. Its server (`urbihw_fakes.endpoint`) says what time it is, in
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
        """Time the traffic as at `baud` bits per second (1 or more)."""
        self.byte_time = BITS_PER_BYTE / baud

    def feed(self, data: bytes, now: float) -> list[Answer]:
        """Pass on bytes of the host, the last of which arrived at `now`; return the timed answers."""
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
        """Receive bytes of the host and return the answers, in order of time."""

    def tick(self, now: float) -> list[Answer]:
        """Advance to `now` and return unsolicited data; most devices send none."""
        return []

    def due(self) -> float | None:
        """Return when the next `tick` with unsolicited data is due; None for never."""
        return None

    def numbers(self) -> tuple[int, ...]:
        """Return the numbers of the units, for faults of one of them; none if the device is one unit."""
        return ()

    def power_off(self, now: float, who: int | None = None) -> None:
        """Switch off unit `who`, or all: it goes limp, loses its RAM and receives nothing."""
        raise NotImplementedError(f"{type(self).__name__} has no power switch")

    def power_on(self, now: float, who: int | None = None) -> None:
        """Switch on again: registers start from their power-on values."""
        raise NotImplementedError(f"{type(self).__name__} has no power switch")
