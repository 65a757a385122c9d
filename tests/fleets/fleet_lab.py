"""A fleet in one process, over TCP on this machine: bridges of robots without daemons, and those who ask."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections import deque
from collections.abc import AsyncIterator, Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from urbihw.client.credentials import Credentials
from urbihw.client.streams import Sample
from urbihw.client.values import Written
from urbihw.client.where import Where
from urbihw.daemon.control_client import NoWorker
from urbihw.fleets.bridge import FleetBridge
from urbihw.fleets.line import FleetLine
from urbihw.fleets.served import ServedRobot
from urbihw.fleets.settings import FleetSettings
from urbihw.web.tree import Tree

LIMIT_S = 10.0
T = TypeVar("T")
TREE: Mapping[str, Any] = {
    "robot": {
        "path": "robot", "slots": [{"name": "stop", "kind": "function"}, {"name": "go", "kind": "function"}],
        "parts": [{
            "path": "robot.body.wheel", "global": "wheel",
            "slots": [{"name": "speed", "readable": True, "writable": True, "effector": True},
                      {"name": "unit", "readable": True, "writable": True, "effector": False}],
        }],
    },
    "platform": {"name": "toy", "path": "toy", "slots": [{"name": "stopped", "kind": "event"}]},
}  # fmt: skip
OVERVIEW = {
    "robot": "toy", "type": "wheeled",
    "effectors": [{"slot": "wheel.speed", "unit": "rad/s", "min": -1.0, "max": 1.0}],
    "sensors": [{"slot": "sonar.val", "unit": "m"}],
}  # fmt: skip


class PlayedWorker:
    """The bus worker: `asked` is what it was told, with the name of the one who asks; it answers unless `dead`."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, str]] = []
        self.holder = ""
        self.dead = False

    async def ask(self, verb: str, who: str = "", others: object = ()) -> dict[str, Any]:
        if self.dead:
            raise NoWorker("there is no bus worker")
        self.asked.append((verb, who))
        released = not (verb == "release" and self.holder not in ("", who))
        if verb == "estop":
            self.holder = who
        elif verb == "release" and released:
            self.holder = ""
        return {"ok": True, "link": True, "estop": self.holder, "released": released}


class PlayedLease:
    """The lease of a connection: how often it was fed."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self.fed = 0

    async def __aenter__(self) -> None:
        self.fed += 1

    def feed(self) -> None:
        self.fed += 1


class PlayedConnection:
    """A connection to the daemon: `did` is what it was told."""

    def __init__(self) -> None:
        self.did: list[Any] = []
        self.connected = True
        self.term = PlayedLease()

    async def run(self, text: str) -> None:
        self.did.append(text)

    def lease(self, seconds: float, fed: bool) -> PlayedLease:
        assert not fed
        self.term.seconds = seconds
        return self.term

    async def write(self, values: Mapping[str, float], timeout: float) -> dict[str, Written]:
        self.did.append(dict(values))
        return {slot: Written(min(value, 1.0), "") for slot, value in values.items()}

    def __getitem__(self, path: str) -> Callable[..., Any]:
        async def call(*args: Any, timeout: float) -> None:
            self.did.append((path, args))
            try:
                await asyncio.sleep(timeout if args == (9.0,) else 0)
            except asyncio.CancelledError:
                self.did.append("cancelled")
                raise

        return call

    async def close(self) -> None:
        self.connected = False


class PlayedRobot(ServedRobot):
    """A robot without a daemon: it has a wheel and a sonar."""

    def __init__(self, settings: FleetSettings) -> None:
        super().__init__(settings)
        self.played = PlayedWorker()
        self.worker = self.played  # type: ignore[assignment]
        self.connections: list[PlayedConnection] = []
        self.dials = asyncio.Event()
        self.dials.set()
        self.dialling = 0
        self.tree, self.overview = Tree(TREE), OVERVIEW

    async def connect(self) -> Any:
        self.dialling += 1
        await self.dials.wait()
        made = PlayedConnection()
        self.connections.append(made)
        return made

    async def run(self) -> None:
        self.state = {"link": True, "verdict": "ok", "reasons": [], "estop": ""}
        self.writers = {"wheel": "anna"}
        while True:
            self.take(["wheel.speed", "sonar.val"], Sample(self._now(), (0.0, 0.5)))
            await asyncio.sleep(0.05)

    def _now(self) -> float:
        import time

        return time.time()

    @property
    def did(self) -> list[Any]:
        """What was done by all connections, but for introductions."""
        return [each for made in self.connections for each in made.did if not isinstance(each, str)]


class FleetLab:
    """Robots of one fleet, by their names."""

    def __init__(self) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
        self.robots: dict[str, PlayedRobot] = {}
        self.tasks: dict[str, asyncio.Task[None]] = {}
        self.lines: deque[FleetLine] = deque()

    async def join(self, name: str, drive: tuple[str, ...] = (), dead_man: float = 2.0) -> FleetBridge:
        """Let a robot join, and wait until it is there, or has ended."""
        settings = FleetSettings(
            "school", name, Where("nowhere", 0), Credentials(), Path("nowhere"), self.endpoint, "toy",
            drive=drive, dead_man=dead_man,
        )  # fmt: skip
        robot = PlayedRobot(settings)
        bridge = FleetBridge(settings, robot)
        task = asyncio.create_task(bridge.run())
        here = asyncio.create_task(bridge.here.wait())
        async with asyncio.timeout(LIMIT_S):
            await asyncio.wait((task, here), return_when=asyncio.FIRST_COMPLETED)
        here.cancel()
        if task.done():
            await task
        self.robots[name], self.tasks[name] = robot, task
        return bridge

    async def leave(self, name: str) -> None:
        """End the bridge of a robot."""
        task = self.tasks.pop(name)
        task.cancel()
        await asyncio.wait((task,), timeout=LIMIT_S)

    async def line(self, name: str = "teacher") -> FleetLine:
        """One who asks."""
        line = await ask(FleetLine, "school", name, self.endpoint)
        self.lines.append(line)
        return line

    async def close(self) -> None:
        """End all."""
        for line in self.lines:
            line.close()
        for name in list(self.tasks):
            await self.leave(name)


async def ask(work: Callable[..., T], *args: Any, **named: Any) -> T:
    """What a blocking question returns."""
    async with asyncio.timeout(LIMIT_S):
        return await asyncio.to_thread(work, *args, **named)


async def until(fits: Callable[[], object]) -> None:
    """Wait until something is so."""
    async with asyncio.timeout(LIMIT_S):
        while not fits():
            await asyncio.sleep(0.01)


@contextlib.asynccontextmanager
async def fleet_lab() -> AsyncIterator[FleetLab]:
    """A fleet without robots."""
    lab = FleetLab()
    try:
        yield lab
    finally:
        await lab.close()
