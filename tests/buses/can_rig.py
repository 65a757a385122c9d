"""A driver of CiA 402 drives, the simulated drives, and a bus between them, in simulated time."""

from __future__ import annotations

from typing import Any, TypeVar

from urbihw.buses import messages as m
from urbihw.buses.can.drives import DrivesDriver
from urbihw.buses.can.frame import CanFrame
from urbihw.buses.can.port import CanPort
from urbihw.buses.clock import BusSimClock
from urbihw.buses.errors import BusTimeout, LinkGone
from urbihw.buses.link import Context, Url
from urbihw_fakes.can.node import CanFrame as FakeFrame
from urbihw_fakes.can.node import Timed
from urbihw_fakes.cia402.node import Drive

T = TypeVar("T")
TICK = 0.01


class RigPort(CanPort):
    """A bus with drives on it; who waits on it lets time pass."""

    def __init__(self, drives: list[Drive], clock: BusSimClock) -> None:
        super().__init__(Url.parse("can://pipe/rig"), Context(clock))
        self.drives = drives
        self.sent: list[CanFrame] = []
        self.dead = self.full = self.deaf = False
        self._coming: list[Timed] = []

    def _open(self) -> None:
        pass

    def _close(self) -> None:
        pass

    def send(self, frame: CanFrame) -> None:
        if self.dead:
            raise LinkGone("unplugged")
        if self.full:
            raise BusTimeout("full")
        self.sent.append(frame)
        for drive in self.drives:
            self._coming += drive.receive_frame(FakeFrame(*frame), self.clock.now())

    def receive(self, limit: int, deadline: float) -> list[CanFrame]:
        if self.dead:
            raise LinkGone("unplugged")
        while True:
            for drive in self.drives:
                self._coming += drive.tick(self.clock.now())
            frames, self._coming = [CanFrame(*frame) for _, frame in self._coming], []
            if self.deaf:
                frames = []
            if frames or self.clock.now() >= deadline:
                return frames
            self.clock.sleep_until(min(self.clock.now() + 0.001, deadline))


class Rig:
    """``rig.run(1)`` lets a second pass; what the driver said is in ``news``."""

    def __init__(self, *drives: Drive, **settings: Any) -> None:
        self.drives = list(drives) or [Drive(5)]
        self.clock = BusSimClock(50.0)
        self.port = RigPort(self.drives, self.clock)
        self.driver = DrivesDriver()
        self.driver.configure(m.Configure(rate=1 / TICK, **settings))
        self.news: list[m.FromWorker] = []

    @property
    def drive(self) -> Drive:
        """The first drive."""
        return self.drives[0]

    def attach(self) -> Rig:
        """Plug it in."""
        self.port.dead = False
        self.news += self.driver.attach(self.port)
        return self

    def run(self, seconds: float) -> Rig:
        """Let time pass in ticks."""
        end = self.clock.now() + seconds
        while self.clock.now() < end - 1e-9:
            self.news += self.driver.tick(self.clock.now(), lambda: None)
            self.clock.sleep_until(self.clock.now() + TICK)
        return self

    def aim(self, item: str, value: Any, number: int = 5) -> None:
        """A new target."""
        self.news += self.driver.targets(m.Targets({(number, item): value}))

    def ask(self, verb: str, item: str = "", value: Any = 0, seconds: float = 3.0, number: int = 5) -> m.Reply:
        """Ask for something and wait for the reply."""
        self.take(m.Reply)
        self.news += self.driver.request(m.Request(7, verb, number, item, value))
        self.run(seconds)
        (reply,) = self.take(m.Reply)
        return reply

    def take(self, kind: type[T]) -> list[T]:
        """The news of a kind since the last time, and forget all others."""
        found: list[T] = [message for message in self.news if isinstance(message, kind)]
        self.news.clear()
        return found

    def values(self, number: int = 5) -> dict[str, int]:
        """What was last measured."""
        return dict([message for message in self.news if isinstance(message, m.Samples)][-1].values[number])
