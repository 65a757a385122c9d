"""What the contract of motion needs of a platform, and the events that end a motion, in simulated time.

Each ``<name>_lab.py`` has a ``MOTION``: how to set each kind of motion going, and how the body of the fake moves.  A
``Scene`` is one robot that moves; its events are what may befall a robot.  All that is looked at is the body.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from multiprocessing import Pipe
from pathlib import Path
from typing import Any, NamedTuple

from lab import START, HandWorker, RobotLab

from urbihw.buses import messages as m
from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.kernel import Kernel
from urbihw.kernel.uobject import RobotSettings, UObject
from urbihw.kernel.uremote.bridge import Bridge
from urbihw.robot import ROBOT_LIBRARY

Numbers = tuple[float, ...]

SPAN = 0.1
"""Seconds over which the speed of a movement is looked at that goes on."""
DEAD_MAN = 0.5
"""Seconds of silence that the tests allow."""


@dataclass(frozen=True)
class Kind:
    """One way to set a robot going.

    Attributes:
        go: what the client says; for a remote UObject, ``slot = number``.
        goes: what the greatest speed of the body then exceeds; in rad/s or m/s.
        prepare: what the client says long before.
        lead: seconds from ``go`` to the event; with 0 nothing has reached the wire.
        live: it goes on by itself, so a lost link does not end it, and a stop ends it by an error.
        error: whether the client reads an error at a stop; as ``live`` if that is None.
        remote: a UObject in another process writes it.
        again: what a client says to see that it moves again; as ``go`` if empty.
        make: a lab of its own, with another model of the robot.
        ready: does with a lab what no client can say.
    """

    go: str
    goes: float
    prepare: str = ""
    lead: float = 1.0
    live: bool = False
    error: bool | None = None
    remote: bool = False
    again: str = ""
    make: Callable[[], Any] | None = None
    ready: Callable[[Any, Path], None] = lambda lab, folder: None

    @property
    def complains(self) -> bool:
        """Whether a client reads that its statement was stopped."""
        return self.live if self.error is None else self.error


@dataclass(frozen=True)
class OtherMaster:
    """One way in which another master than this daemon sets the robot going.

    Attributes:
        go: what it does to the simulated robot.
        goes: what the greatest speed of the body then exceeds; in rad/s or m/s.
        prepare: what a client of ours says before; it moves nothing.
        make: a lab of its own, with another model of the robot.
        ready: does with a lab what no client can say.
        lead: seconds in which it gets so fast.
    """

    go: Callable[[Any], None]
    goes: float
    prepare: str = ""
    make: Callable[[], Any] | None = None
    ready: Callable[[Any, Path], None] = lambda lab, folder: None
    lead: float = 0.5


@dataclass(frozen=True)
class Motion:
    """What a platform says of its motion.

    Attributes:
        make: a lab whose robot is open.
        kinds: by name.
        others: other masters, by name; without them, how it is known that there can be none (`alone`).
        look: speeds of all parts of the body (rad/s, m/s), and where they are (rad, m); a part that is only on
            or off has the speed 1 while it is on, and as its place the seconds for which it has been on.
        slot: the object with ``estop`` and ``link``.
        unplug, plug: the adapter.
        revive: what a client says to switch on what an event has switched off.
        standstill: seconds in which the body stands after a stop; measured, rounded up.
        rest: speed below which it stands; drift: how far it may then still move in five seconds.
        found: what the worker has told of the devices that it found, as far as another one makes use of it.
        grain: what the quantisation of targets adds to a speed.
    """

    make: Callable[[], Any]
    kinds: dict[str, Kind]
    look: Callable[[Any], tuple[Numbers, Numbers]]
    slot: str
    unplug: Callable[[Any], None]
    plug: Callable[[Any], None]
    revive: str = ""
    standstill: float = 0.5
    rest: float = 0.01
    drift: float = 0.01
    grain: float = 0.0
    found: Callable[[Any], tuple[Any, ...]] = lambda lab: ()
    others: dict[str, OtherMaster] = field(default_factory=dict)
    alone: str = ""


class Sample(NamedTuple):
    """The body at a moment."""

    time: float
    speed: float
    place: Numbers


class Mover(UObject):
    """A device in another process that writes somebody else's variable."""

    def init(self) -> None:
        """Called by ``new``."""


class Remote:
    """A process with devices, at the end of a connection to the kernel of a lab."""

    def __init__(self, kernel: Kernel, clock: Any) -> None:
        self._server = kernel
        self._devices = Kernel(clock, libraries=(ROBOT_LIBRARY,))
        self._devices.host.register(Mover)
        self._there: list[bytes | memoryview] = []
        self._bridge = Bridge(self._devices.host, "mover_1", self._there.extend)
        self.lobby = kernel.open_lobby("127.0.0.1")
        self._bridge.connected()

    def write(self, text: str) -> None:
        """``slot = number``"""
        name, _, value = text.rstrip(";").partition(" = ")
        self._devices.host.var(name).set(float(value))

    def run(self) -> None:
        """Carry bytes both ways until there are none."""
        if not self.lobby.connected:
            return
        busy = True
        while busy:
            self._devices.run()
            there, back = b"".join(self._there), self.lobby.output.take_bytes()
            self._there.clear()
            busy = bool(there or back)
            self.lobby.feed(there)
            self._bridge.receive(back)
            self._server.run()


class DeadWorker(HandWorker):
    """A worker that was killed: time passes, and its messages are lost."""

    def __init__(self, lab: RobotLab) -> None:
        self.pipe, self._theirs = Pipe()
        self.sent: list[m.ToWorker] = []
        self._backlog = deque()
        self._lab = lab

    def send(self, message: m.ToWorker) -> None:
        self.sent.append(message)

    def step(self) -> None:
        clock = self._lab.bus_clock
        clock.sleep_until(clock.now() + self._lab.tick)


@dataclass
class Scene:
    """A robot that moves, from ``begin`` on.

    Attributes:
        measured: goes into the report of the test.
        stay: seconds for which a body that stands is looked at.
    """

    motion: Motion
    kind: Kind
    folder: Path
    measured: list[tuple[str, object]]
    stay: float = 5.0
    samples: list[Sample] = field(default_factory=list)
    held: bool = False

    def __post_init__(self) -> None:
        self.lab: Any = (self.kind.make or self.motion.make)()
        self.lab.look(self.motion.revive)
        self.remote = Remote(self.lab.kernel, self.lab.clock) if self.kind.remote else None
        self.run(1.0)
        self.kind.ready(self.lab, self.folder)
        self.prepare()

    # ---------------------------------------------------------------- time

    def step(self) -> None:
        """One tick."""
        if self.remote is not None and not self.held:
            self.remote.run()
        self.lab.step()
        self.lab.thought()
        speeds, place = self.motion.look(self.lab)
        self.samples.append(Sample(self.now(), max(map(abs, speeds)), place))

    def now(self) -> float:
        """The time of the bus, which is ahead of the kernel's while a worker meets its devices."""
        now: float = self.lab.bus_clock.now()
        return now - START

    def run(self, seconds: float) -> None:
        """Let time pass."""
        end = self.now() + seconds
        while self.now() < end - 1e-9:
            self.step()

    def gets_faster(self, speed: float, seconds: float) -> bool:
        """Let time pass until the body is faster than this; false if it was not within some time."""
        end = self.now() + seconds
        while self.now() < end - 1e-9:
            self.step()
            if self.samples[-1].speed > speed:
                return True
        return False

    def peak(self, since: float, until: float = 1e9) -> float:
        """The greatest speed in some time."""
        return max((sample.speed for sample in self.samples if since <= sample.time <= until), default=0.0)

    def pace(self, since: float, until: float = 1e9) -> float:
        """The greatest speed in some time, each time over ``SPAN``: servos go in steps, one for each target."""
        places = [sample.place for sample in self.samples if since < sample.time <= until]
        count = round(SPAN / self.lab.tick)
        pairs = zip(places, places[count:], strict=False)
        ways = (abs(math.remainder(b - a, math.tau)) for one, other in pairs for a, b in zip(one, other, strict=True))
        return max(ways, default=0.0) / SPAN

    def moved_last(self) -> float:
        """When the body last moved."""
        return max((sample.time for sample in self.samples if sample.speed > self.motion.rest), default=0.0)

    def drift(self, since: float) -> float:
        """How far the body has moved after a time, at most."""
        places = [sample.place for sample in self.samples if sample.time > since]
        return max(abs(b - a) for place in places for a, b in zip(places[0], place, strict=True))

    # ---------------------------------------------------------------- what is said

    def prepare(self) -> None:
        """What the client says long before."""
        if self.kind.prepare:
            assert "!!!" not in self.lab.say(self.kind.prepare)
            self.run(1.0)
            assert "!!!" not in self.lab.heard()

    def go(self, text: str = "") -> None:
        """Set it going."""
        text = text or self.kind.go
        if self.remote is not None:
            self.remote.write(text)
            self.remote.run()
        else:
            self.lab.kernel.feed(self.lab.lobby, text.encode())
            self.lab.run(0)

    def begin(self) -> None:
        """Set it going, up to the event."""
        self.go()
        self.run(self.kind.lead)
        if self.kind.lead >= 0.5:
            peak = self.peak(self.now() - self.kind.lead)
            assert peak > self.kind.goes, f"it does not move: {self.heard()}"

    def heard(self) -> str:
        """What the client has read."""
        said: str = self.lab.heard()
        return said

    def new_client(self) -> None:
        """Another one takes the place of the client."""
        self.lab.lobby = self.lab.kernel.open_lobby()
        if self.kind.remote:
            self.remote = Remote(self.lab.kernel, self.lab.clock)
        self.run(0.1)
        self.lab.heard()
        self.prepare()

    # ---------------------------------------------------------------- events

    def stop(self) -> None:
        """Another client stops the robot."""
        self.lab.look("robot.stop")

    def estop(self) -> None:
        """Another client asks for an emergency stop."""
        self.lab.look(f"{self.motion.slot}.estop = true")

    def silence(self, seconds: float) -> None:
        """The kernel stands still while the bus goes on, as when the daemon is held."""
        scheduler, clock = self.lab.kernel.scheduler, self.lab.clock
        self.held = True
        scheduler.run_simulated = lambda until=None: clock.idle(until)
        try:
            self.run(seconds)
        finally:
            self.held = False
            del scheduler.run_simulated

    def watch_master(self) -> None:
        """Let the worker stop the robot when it hears nothing."""
        lab = self.lab
        lab.robot.configure(RobotSettings(lab.url, 1 / lab.tick, dead_man=DEAD_MAN))
        self.run(0.2)

    def client_gone(self) -> None:
        """The connection ends."""
        (self.lab.lobby if self.remote is None else self.remote.lobby).close()

    def link_lost(self, seconds: float, meanwhile: Callable[[], None] = lambda: None) -> None:
        """The adapter is pulled and put back; comes back when the link is up."""
        self.motion.unplug(self.lab)
        self.run(seconds / 2)
        meanwhile()
        self.run(seconds / 2)
        assert self.lab.look(f"{self.motion.slot}.link") == "false"
        self.motion.plug(self.lab)
        end = self.now() + 10
        while self.lab.look(f"{self.motion.slot}.link") != "true":
            assert self.now() < end, "the link does not come back"
            self.step()

    def worker_killed(self, gap: float) -> None:
        """The worker dies, and after ``gap`` seconds another one has its place: see ``Supervisor``."""
        robot, old = self.lab.robot, self.lab.worker
        epoch = max([robot.motion.epoch, *(x.epoch for x in old.sent if isinstance(x, m.Stop | m.Targets))]) + 1
        dead = DeadWorker(self.lab)
        self._put(dead)
        robot._post(m.WorkerState("it was killed; another one is started"))
        self.run(gap)
        settings = [x for x in old.sent if isinstance(x, m.Configure)] or [m.Configure(1 / self.lab.tick, dead_man=0)]
        begin = m.Begin(settings[-1], epoch=epoch, instead="it was killed", devices=self.motion.found(self.lab))
        kept = [x for x in old.sent if isinstance(x, m.Configure | m.Watch | m.Limits)]
        begin = replace(begin, watches=tuple(x for x in kept if isinstance(x, m.Watch)))
        new = HandWorker(
            lambda mailbox: Engine(self.lab.url, driver_of(robot.family), mailbox, begin, self.lab.context()),
            robot._post,
        )
        for message in kept:
            if isinstance(message, m.Limits):
                new.send(message)
        new.sent[:0] = kept
        self._put(new)

    def _put(self, worker: HandWorker) -> None:
        self.lab.worker = self.lab.robot.worker.handle = worker
        if hasattr(self.lab, "workers"):
            self.lab.workers = [worker]
