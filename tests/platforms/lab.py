"""A kernel, a platform and its fake, all in simulated time: what the tests of a platform drive.

The bus worker is the real engine, stepped by hand between the rounds of the kernel; no thread, no real clock.  Each
platform has its own `<name>_lab.py` with a subclass of ``RobotLab`` called ``Lab``.
"""

from __future__ import annotations

import contextlib
import select
import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from multiprocessing import Pipe
from types import SimpleNamespace
from typing import Any, ClassVar, Self

from urbihw.buses import messages as m
from urbihw.buses.clock import BusSimClock as BusClock
from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.buses.errors import LinkGone
from urbihw.buses.link import Context
from urbihw.buses.mailbox import Joiner, Mailbox
from urbihw.buses.pipe import PipeEnd
from urbihw.buses.verdict import judge
from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import DeviceError, RobotSettings
from urbihw.platforms import find, load
from urbihw.platforms.base import WiredRobot
from urbihw.robot import ROBOT_LIBRARY
from urbihw_fakes.console import Command, Console
from urbihw_fakes.device import Answer, Device

MOST_UNREAD = 100
"""Messages that a pipe takes without a reader."""
START = 100.0
"""The bus begins at another time than the kernel, as in life."""


class HandWorker:
    """The worker's engine in this thread, with the face of a ``Worker``."""

    def __init__(self, engine: Callable[[Mailbox], Engine], post: Callable[[m.FromWorker], None]) -> None:
        self.pipe, theirs = Pipe()
        self._engine = engine(Mailbox(theirs))
        self._post = post
        self.sent: list[m.ToWorker] = []
        self._backlog: deque[m.ToWorker] = deque()
        self._joiner = Joiner()

    def send(self, message: m.ToWorker) -> None:
        """Hand a message to the engine, and remember it.

        As in a ``Supervisor``, targets and heartbeats never wait for room, and the others are queued.
        """
        if len(self._backlog) >= MOST_UNREAD:
            if isinstance(message, m.Targets):
                raise LinkGone("the worker does not read its messages")
            if isinstance(message, m.Heartbeat):
                return
        self.sent.append(message)
        self._backlog.append(message)

    def step(self) -> None:
        """One step of the engine; what it says is posted."""
        self._flush()
        self._engine.step()
        with contextlib.suppress(EOFError):
            # `Connection.poll` makes a selector each time, which is ten times slower.
            while select.select((self.pipe,), (), (), 0)[0]:
                message = self._joiner.add(self.pipe.recv())
                if message is not None:
                    self._post(message)

    def stop(self) -> None:
        """The platform lets go."""
        self._flush()
        self.pipe.close()

    def _flush(self) -> None:
        """Fill the pipe with as much as it takes without a reader."""
        for _ in range(min(len(self._backlog), MOST_UNREAD)):
            self.pipe.send(self._backlog.popleft())


class RobotLab:
    """``lab.say("motor6.val;")`` gives what a client would read; ``lab.run(2)`` lets two seconds pass.

    A subclass names the ``platform`` and says in ``context`` what the worker finds at ``url``.
    """

    platform: ClassVar[str]
    url: ClassVar[str] = "pipe://robot"
    memory: ClassVar[str] = ""
    """The file of the devices of the last run."""
    motions: ClassVar[str] = ""
    """The folder of motions."""
    tick: ClassVar[float] = 0.01
    """Seconds between two looks at both clocks: a tick of the worker."""

    def __init__(self, **options: Any) -> None:
        """``options`` are those of the platform; ``limits``, ``resume`` and ``devices`` are those of the settings."""
        limits, resume, devices = options.pop("limits", {}), options.pop("resume", True), options.pop("devices", {})
        self.clock = SimClock()
        self.bus_clock = BusClock(START)
        self.kernel = Kernel(self.clock, libraries=(ROBOT_LIBRARY,))
        self.lobby = self.kernel.open_lobby()
        self.observer = self.kernel.open_lobby()
        self.opened: list[DeviceError | None] = []
        self.worker: HandWorker | None = None
        host = self.kernel.host
        manifest = find(self.platform)
        kind = load(manifest)
        assert issubclass(kind, WiredRobot)
        for known in (kind, *kind.classes):
            host.register(known)
        for path in manifest.library_files():
            host.run(path.read_text("latin-1"), path.name, self._loaded)
        self.robot = host.create(kind, manifest.slot)
        self.robot.start_worker = self._start
        self.robot.bus_time = self.bus_clock.now
        settings = RobotSettings(
            self.url, 1 / self.tick, dead_man=0, options=options, limits=limits, resume=resume, memory=self.memory,
            devices=devices, motions=self.motions,
        )  # fmt: skip
        self.robot.open(settings, self.opened.append)

    def context(self) -> Context:
        """The clock and the pipes of the worker."""
        raise NotImplementedError

    def console(self) -> Console:
        """The console of the fake, as `python -m urbihw_fakes` has it."""
        raise NotImplementedError

    def thought(self) -> bool:
        """Wait for threads of the platform, which know nothing of simulated time; true."""
        for thread in threading.enumerate():
            if thread.name in ("planner", "urbihw-uobject"):
                thread.join(20)
        return True

    @classmethod
    def ready(cls, *arguments: Any, **options: Any) -> Self:
        """A lab whose robot is open."""
        lab = cls(*arguments, **options)
        lab.until(lambda: bool(lab.opened))
        assert lab.opened == [None], f"the robot did not open: {lab.opened[0]}"
        return lab

    def say(self, text: str, seconds: float = 0.0) -> str:
        """Feed a program, let time pass (at least one tick), and give the answer without its time stamps."""
        self.kernel.feed(self.lobby, text.encode("latin-1"))
        self.run(seconds)
        return self.heard()

    def heard(self) -> str:
        """What the client reads, without the time stamps."""
        return _unstamped(self.lobby.output.take_bytes())

    def look(self, text: str) -> str:
        """The value of an expression, as a second client reads it at once, whatever the first is waiting for."""
        self.kernel.feed(self.observer, text.encode("latin-1") + b";")
        self.run(0)
        return _unstamped(self.observer.output.take_bytes())

    def number(self, text: str) -> float:
        """The value of an expression that is a number."""
        return float(self.look(text))

    def run(self, seconds: float) -> None:
        """Let time pass on both clocks."""
        end = self.clock.now() + seconds
        self.kernel.scheduler.run_simulated(self.clock.now())
        while self.clock.now() < end - 1e-9:
            self.step()

    def step(self) -> None:
        """One tick of the bus, and the kernel up to the same time."""
        self.kernel.scheduler.run_simulated(self.clock.now() + self.tick)
        if self.worker is not None:
            while self.bus_clock.now() - START < self.clock.now():
                self.worker.step()
        self.kernel.scheduler.run_simulated(self.clock.now())

    def findings(self) -> list[str]:
        """What the verdict on the health, as its worker tells it, says of the devices."""
        assert self.worker is not None
        now = self.bus_clock.now()
        told = self.worker._engine._health.fields(now, now, True) | {"link": True}
        return [str(finding) for finding in judge(told) if finding.device]

    def until(self, done: Callable[[], bool], patience: float = 10.0) -> None:
        """Let time pass until something holds."""
        end = self.clock.now() + patience
        while not done():
            assert self.clock.now() < end, "it did not happen in time"
            self.step()

    def console_of(self, device: Device, end: PipeEnd, words: Mapping[str, Command]) -> Console:
        """A console over a device at the end of a pipe, with words of its own."""
        clock = self.bus_clock.now
        cable: Any = SimpleNamespace(device=device, clock=clock, unplug=end.unplug, plug=end.replug)
        return Console(cable, words)

    def sent(self, kind: type[m.ToWorker]) -> list[Any]:
        """The messages of one kind that the platform has sent to the worker since the last call."""
        assert self.worker is not None
        found = [message for message in self.worker.sent if isinstance(message, kind)]
        self.worker.sent.clear()
        return found

    def _loaded(self, problem: str) -> None:
        assert problem == ""

    def _start(
        self, url: str, *, post: Callable[[m.FromWorker], None], settings: m.Configure, family: str, control: str = ""
    ) -> HandWorker:
        def engine(mailbox: Mailbox) -> Engine:
            return Engine(url, driver_of(family), mailbox, m.Begin(settings), self.context())

        self.worker = HandWorker(engine, post)
        return self.worker


class SpeakingLab(RobotLab):
    """A lab whose robot is one device on one pipe that speaks also unasked; a subclass makes ``device`` first."""

    device: Device

    def __init__(self, **options: Any) -> None:
        """``options`` are those of the platform."""
        self.end = PipeEnd(lambda data, at: self._answer(self.device.feed(data, at)))
        super().__init__(**options)

    def context(self) -> Context:
        return Context(self.bus_clock, {"robot": self.end})

    def step(self) -> None:
        answers = self.device.tick(self.bus_clock.now())
        if self.end.plugged:
            self._answer(answers)
        super().step()

    def _answer(self, answers: Iterable[Answer]) -> None:
        for answer in answers:
            self.end.send(answer.data, answer.at)


def _unstamped(data: bytes) -> str:
    return "\n".join(line.partition("] ")[2] for line in data.decode("latin-1").splitlines())
