"""The service manager's watchdog is fed while the bus is served, and no longer."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from urbihw.buses import messages as m
from urbihw.daemon import service as module
from urbihw.daemon.config import Config
from urbihw.daemon.notify import ServiceNotifier
from urbihw.daemon.service import DaemonService
from urbihw.kernel import Kernel
from urbihw.kernel.process import KernelProcess
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import PlatformRobot, RobotSettings
from urbihw.platforms.base import WiredRobot
from urbihw.platforms.session import SILENCE_TIMEOUT_S


class Manager(ServiceNotifier):
    """Notes what the service manager would hear."""

    def __init__(self) -> None:
        super().__init__("", 0.01)
        self.said: list[str] = []

    def _send(self, *lines: str) -> None:
        self.said += lines


class Stub:
    """A robot of which a test says whether it lives."""

    def __init__(self, lives: Callable[[int], bool]) -> None:
        self.asked = 0
        self._lives = lives

    def alive(self) -> bool:
        self.asked += 1
        return self._lives(self.asked)

    def waits_for(self) -> str:
        return ""

    def status(self) -> str:
        return "well"


async def report(robot: object, rounds: int) -> list[str]:
    """What the service manager hears of a robot in some rounds."""
    manager = Manager()
    service = DaemonService(Config(platform="stub"), manager)
    service._robot = robot  # type: ignore[assignment]
    service._process = KernelProcess()
    reporting = asyncio.ensure_future(service._report())
    while getattr(robot, "asked", rounds) < rounds:
        await asyncio.sleep(0.005)
    await asyncio.sleep(0)
    service.stop()
    await reporting
    return manager.said


def test_it_is_fed_while_the_robot_is_alive() -> None:
    said = asyncio.run(report(Stub(lambda asked: True), 5))
    assert said[0] == "STATUS=stub: well"
    assert said.count("WATCHDOG=1") >= 5


def test_it_starves_when_the_robot_is_not_and_is_fed_again() -> None:
    stub = Stub(lambda asked: asked <= 2 or asked > 6)
    said = asyncio.run(report(stub, 8))
    assert said.count("WATCHDOG=1") == stub.asked - 4


def test_without_a_robot_it_is_fed() -> None:
    assert "WATCHDOG=1" in asyncio.run(report(None, 0))


def test_it_is_fed_twice_in_the_time_that_the_manager_gives() -> None:
    notifier = ServiceNotifier.from_environment({"WATCHDOG_USEC": "1000000"})
    assert notifier.watchdog_period == 0.5 < module.STATUS_PERIOD_S


# ---------------------------------------------------------------- a robot on a wire


class Deaf:
    """A worker that keeps its messages."""

    def __init__(self, post: Callable[[m.FromWorker], None]) -> None:
        self.post = post

    def send(self, message: m.ToWorker) -> None:
        """Nothing."""

    def stop(self) -> None:
        """Nothing."""


class Wired(WiredRobot):
    """A robot with nothing on its wire."""

    family = "servos"
    robot_name = "wired"
    now = 100.0

    def status(self) -> str:
        return ""

    def on_found(self, message: m.Found) -> None:
        pass

    def on_samples(self, message: m.Samples) -> None:
        pass

    def is_complete(self) -> bool:
        return True


class Rig:
    """That robot, open, with a worker that says what a test says, and a clock that goes on when a test says so."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.kernel.host.register(Wired)
        self.robot = self.kernel.host.create(Wired, "wired")
        self.time = 100.0
        self.workers: list[Deaf] = []
        self.robot.start_worker = self._start
        self.robot.bus_time = lambda: self.time
        self.robot.open(RobotSettings("pipe://robot"), lambda error: None)

    def _start(self, url: str, *, post: Callable[[m.FromWorker], None], **others: Any) -> Deaf:
        self.workers.append(Deaf(post))
        return self.workers[-1]

    def hear(self, message: m.FromWorker) -> None:
        self.workers[-1].post(message)
        self.kernel.scheduler.run_simulated(0.0)


@pytest.fixture
def rig() -> Rig:
    return Rig()


@pytest.mark.parametrize(
    "message",
    [
        m.Samples(1.0, {}, {}),
        m.Statistics(1.0, 100.0, 0),
        m.LinkState(False, "unplugged"),
        m.WorkerHeartbeat(0.4),
    ],
    ids=lambda message: type(message).__name__,
)
def test_a_worker_that_is_heard_is_alive_also_without_its_link(rig: Rig, message: m.FromWorker) -> None:
    assert rig.robot.alive()
    rig.time += SILENCE_TIMEOUT_S + 0.1
    assert not rig.robot.alive()
    rig.hear(message)
    assert rig.robot.alive()
    rig.time += SILENCE_TIMEOUT_S - 0.1
    assert rig.robot.alive()
    rig.time += 0.2
    assert not rig.robot.alive()


@pytest.mark.parametrize("message", [m.WorkerState("it hangs"), m.Ended("it died")])
def test_what_others_say_of_a_worker_is_no_sign_of_its_life(rig: Rig, message: m.FromWorker) -> None:
    rig.time += SILENCE_TIMEOUT_S + 0.1
    rig.hear(message)
    assert not rig.robot.alive()


def test_a_robot_without_a_worker_is_alive() -> None:
    kernel = Kernel(SimClock())

    class Plain(PlatformRobot):
        """A robot that needs no bus."""

    kernel.host.register(Plain)
    assert kernel.host.create(Plain, "plain").alive()
