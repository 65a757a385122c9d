"""A driver and a simulated robot at the two ends of a pipe, in simulated time: no worker, no kernel."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Self

from urbihw.buses import messages as m
from urbihw.buses.clock import BusSimClock
from urbihw.buses.driver import Driver
from urbihw.buses.link import Context, Url
from urbihw.buses.pipe import PipeEnd, PipeLink
from urbihw_fakes.device import Device

START = 100.0


class LivingClock(BusSimClock):
    """A clock on which a robot lives on while somebody sleeps: ``live`` is called at least every ``period`` seconds."""

    def __init__(self, start: float, period: float, live: Callable[[float], None]) -> None:
        super().__init__(start)
        self._period = period
        self._live = live

    def sleep_until(self, when: float) -> None:
        """Pass the time in steps."""
        while self.now() < when:
            super().sleep_until(min(when, self.now() + self._period))
            self._live(self.now())


class DriverRig:
    """``rig.run(1)`` lets a second pass and returns what the driver has told; ``news`` is all that it has told.

    A subclass names its ``driver_class`` and gives the device; it may record what goes over the wire (``receive``) and
    do more to connect (``attach``).
    """

    driver_class: ClassVar[type[Driver]]
    link_class: ClassVar[type[PipeLink]] = PipeLink
    url: ClassVar[str] = "pipe://robot?baud=10000000"
    tick: ClassVar[float] = 0.02
    """Seconds between two ticks of the driver."""

    def __init__(self, device: Device, **settings: Any) -> None:
        """``settings`` are those of ``Configure``."""
        self.device = device
        self.clock = LivingClock(START, self.tick, self._live)
        self.end = PipeEnd(self.receive)
        self.link = self.link_class(Url.parse(self.url), Context(self.clock, {"robot": self.end}))
        self.driver = self.driver_class()
        self.driver.configure(m.Configure(rate=1 / self.tick, **settings))
        self.news: list[Any] = []

    def receive(self, data: bytes, at: float) -> None:
        """Hand the robot what the driver has written, and send its answers."""
        for answer in self.device.feed(data, at):
            self.end.send(answer.data, answer.at)

    def _live(self, now: float) -> None:
        """Let the robot live to this time; without a cable its messages are lost."""
        for answer in self.device.tick(now):
            if self.end.plugged:
                self.end.send(answer.data, answer.at)

    def attach(self) -> Self:
        """Connect."""
        self.link.open()
        self.news += self.driver.attach(self.link)
        return self

    def run(self, seconds: float) -> list[Any]:
        """Tick for so long; what the driver has told."""
        fresh: list[Any] = []
        end = self.clock.now() + seconds
        while self.clock.now() < end - 1e-9:
            start = self.clock.now()
            fresh += self.driver.tick(start, lambda: None)
            self.clock.sleep_until(start + self.tick)
        self.news += fresh
        return fresh

    def write(self, targets: Mapping[tuple[Any, str], Any]) -> list[Any]:
        """Write targets; what the driver answers."""
        return self.driver.targets(m.Targets(dict(targets)))

    def send_request(self, verb: str, device: Any, item: Any = "", value: Any = 0, number: int = 1) -> list[Any]:
        """Send a request; what the driver answers at once."""
        return self.driver.request(m.Request(number, verb, device, item, value))
