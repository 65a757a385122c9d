"""A driver of an RMP, the simulated base, and a bus between them, in simulated time: no worker, no kernel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from urbihw.buses import messages as m
from urbihw.buses.can.frame import CanFrame
from urbihw.buses.can.port import CanPort
from urbihw.buses.clock import BusSimClock
from urbihw.buses.errors import BusTimeout, LinkGone
from urbihw.buses.link import Context, Url
from urbihw.platforms.segway.driver import BASE, RmpDriver
from urbihw_fakes.can.node import CanFrame as FakeFrame
from urbihw_fakes.can.node import Timed
from urbihw_fakes.segway.rmp import SegwayRmp

T = TypeVar("T")
START = 50.0
TICK = 0.02


class RigPort(CanPort):
    """A bus with a base on it.

    Attributes:
        sent: (time, frame) of all that the driver sent.
        dead: everything raises LinkGone.
        full: nothing is acknowledged.
        deaf: what the base says is lost.
        lost: which of its frames are lost.
        others: frames that others put on the bus, to be read next.
    """

    def __init__(self, base: SegwayRmp, clock: BusSimClock) -> None:
        super().__init__(Url.parse("can://pipe/rig"), Context(clock))
        self.base = base
        self.sent: list[tuple[float, CanFrame]] = []
        self.dead = self.full = self.deaf = False
        self.lost: Callable[[CanFrame], bool] = lambda frame: False
        self.others: list[CanFrame] = []

    def _open(self) -> None:
        pass

    def _close(self) -> None:
        pass

    def send(self, frame: CanFrame) -> None:
        if self.dead:
            raise LinkGone("unplugged")
        if self.full:
            raise BusTimeout("full")
        self.sent.append((self.clock.now(), frame))
        self.base.receive_frame(FakeFrame(frame.id, frame.data), self.clock.now())

    def receive(self, limit: int, deadline: float) -> list[CanFrame]:
        if self.dead:
            raise LinkGone("unplugged")
        said = [frame for frame in map(_plain, self.base.tick(self.clock.now())) if not self.lost(frame)]
        others, self.others = self.others, []
        return [] if self.deaf else [*others, *said][:limit]


def _plain(timed: Timed) -> CanFrame:
    return CanFrame(*timed.frame)


class Rig:
    """``rig.run(1)`` lets a second pass; what the driver said is in ``news``, why it stopped by itself in ``halts``."""

    def __init__(self, base: SegwayRmp | None = None, **settings: Any) -> None:
        self.base = base if base is not None else SegwayRmp()
        self.clock = BusSimClock(START)
        self.port = RigPort(self.base, self.clock)
        self.driver = RmpDriver()
        self.driver.configure(m.Configure(rate=1 / TICK, **settings))
        self.news: list[m.FromWorker] = []
        self.halts: list[str] = []
        self.driver.watch(m.Watch(BASE, ()), START)
        self.attach()

    def attach(self) -> None:
        """Plug it in."""
        self.port.dead = False
        self.news += self.driver.attach(self.port)

    def run(self, seconds: float, tick: float = TICK) -> None:
        """Let time pass in ticks."""
        for _ in range(round(seconds / tick)):
            self.news += self.driver.tick(self.clock.now(), lambda: None)
            if self.driver.halted:
                # As the engine does it.
                self.halts.append(self.driver.halted)
                self.driver.halted = ""
                self.driver.safe_stop()
            self.clock.sleep_until(self.clock.now() + tick)

    def aim(self, **counts: int) -> None:
        """New targets."""
        self.news += self.driver.targets(m.Targets({(BASE, item): value for item, value in counts.items()}))

    def ask(self, verb: str, item: str = "", value: Any = 0, seconds: float = 1.0) -> m.Reply:
        """Ask for something and wait for the reply."""
        self.take(m.Reply)
        self.news += self.driver.request(m.Request(7, verb, BASE, item, value))
        self.run(seconds)
        (reply,) = self.take(m.Reply)
        return reply

    def take(self, kind: type[T]) -> list[T]:
        """The news of a kind since the last time, and forget all others."""
        found: list[T] = [message for message in self.news if isinstance(message, kind)]
        self.news.clear()
        return found

    def values(self) -> dict[str, int]:
        """The last cycle that was reported."""
        return dict([message for message in self.news if isinstance(message, m.Samples)][-1].values[BASE])

    def gaps(self) -> list[float]:
        """Seconds between commands."""
        times = [at for at, frame in self.port.sent if frame.id == 0x413]
        return [later - earlier for earlier, later in zip(times, times[1:], strict=False)]
