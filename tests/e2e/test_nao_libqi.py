"""The driver of the Nao over both back ends, each with both simulated robots; and libqi's own client with our robot.

libqi (PyPI ``qi``) is there on x86-64 only.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from urbihw import buses
from urbihw.buses.link import Port
from urbihw.buses.messages import (
    Configure,
    DeviceReport,
    Ended,
    Found,
    FromWorker,
    LinkState,
    Reply,
    Request,
    Samples,
    Targets,
)
from urbihw.buses.worker import Worker
from urbihw_nao.driver import NaoDriver
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.endpoint import NaoEndpoint

if importlib.util.find_spec("qi") is None:
    pytest.skip("libqi is not there", allow_module_level=True)
pytestmark = pytest.mark.e2e

HERE = Path(__file__).parent
FAKES = Path(__file__).parents[2] / "fakes"
WITHIN_S = 20.0
"""Generous: on a busy machine a process may be held up for seconds."""


class Robot:
    """A simulated Nao in a process of its own, and its console."""

    def __init__(self, *options: str) -> None:
        command = [sys.executable, "-m", "urbihw_fakes", "nao", "--tcp", "0", "--until-eof", *options]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=FAKES
        )  # fmt: skip
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip().removeprefix("qi://")

    def say(self, line: str) -> str:
        """A line at the console, and the first line of the answer."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().strip()

    def close(self) -> int:
        """End it; return its exit code."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        code = self.process.wait(WITHIN_S)
        self.process.stdout.close()
        return code


@pytest.fixture(params=["pure", "libqi"])
def robot(request: pytest.FixtureRequest) -> Iterator[Robot]:
    """Pure Python, or behind a real libqi."""
    made = Robot(*(["--libqi"] if request.param == "libqi" else []))
    yield made
    assert made.close() == 0, "libqi crashes in a process that ends with an open session"


class Rig:
    """The driver with its own loop, and what it has told."""

    def __init__(self, port: Port) -> None:
        self.driver = NaoDriver()
        self.driver.configure(Configure(rate=50.0))
        self.told: list[FromWorker] = self.driver.attach(port)
        self.values: dict[Any, dict[str, Any]] = {}
        self._count = 0

    def run_until(self, reached: Callable[[], bool]) -> None:
        """Tick until a condition holds."""
        end = time.monotonic() + WITHIN_S
        while not reached():
            now = time.monotonic()
            assert now < end, f"not reached; told: {self.told[-5:]}"
            for message in self.driver.tick(now, lambda: None):
                if isinstance(message, Samples):
                    for device, items in message.values.items():
                        self.values.setdefault(device, {}).update(items)
                else:
                    self.told.append(message)
            time.sleep(0.005)

    def ask(self, verb: str, device: str, item: str = "", *arguments: Any) -> Reply:
        """A request, and its reply."""
        self._count += 1
        number = self._count
        self.told += self.driver.request(Request(number, verb, device, item, arguments))

        def replies() -> list[Reply]:
            return [each for each in self.told if isinstance(each, Reply) and each.reply_id == number]

        self.run_until(lambda: bool(replies()))
        return replies()[0]

    def angle(self, joint: str) -> float:
        """As it was measured last."""
        return float(self.values.get(joint, {}).get("angle", 0.0))


@pytest.fixture(params=["qi", "libqi"])
def rig(request: pytest.FixtureRequest, robot: Robot) -> Iterator[Rig]:
    """By our own back end, or libqi's."""
    with buses.open(f"{request.param}://{robot.address}") as port:
        made = Rig(port)
        yield made
        made.driver.detach()


def test_joints_go_where_they_are_told(rig: Rig, robot: Robot) -> None:
    (found,) = (each for each in rig.told if isinstance(each, Found))
    assert len(found.devices[0].joints) == 26
    rig.driver.targets(Targets({("HeadYaw", "stiffness"): 1.0, ("LHand", "stiffness"): 1.0}))
    rig.run_until(lambda: rig.values.get("HeadYaw", {}).get("stiffness", 0.0) == 1.0)
    rig.driver.targets(Targets({("HeadYaw", "angle"): 0.4, ("LHand", "angle"): 0.7}))
    rig.run_until(lambda: abs(rig.angle("HeadYaw") - 0.4) < 0.01 and abs(rig.angle("LHand") - 0.7) < 0.01)
    assert abs(float(robot.say("joints").split()[1]) - 0.4) < 0.01


def test_it_walks_and_a_stop_ends_it(rig: Rig, robot: Robot) -> None:
    assert rig.ask("call", "ALMotion", "wakeUp").ok
    rig.driver.targets(Targets({("walk", "x"): 0.1, ("walk", "y"): 0.0, ("walk", "yaw"): 0.0}))
    rig.run_until(lambda: rig.values.get("walk", {}).get("x", 0.0) > 0.05)
    assert robot.say("where").endswith("walking")
    rig.driver.safe_stop()
    rig.run_until(lambda: robot.say("where").endswith("standing"))


def test_calls_and_events_of_services(rig: Rig, robot: Robot) -> None:
    assert rig.ask("describe", "ALBattery").value == ["exit", "getBatteryCharge", "ping", "version"]
    assert rig.ask("call", "ALBattery", "getBatteryCharge").value == 80
    failed = rig.ask("call", "ALMotion", "getAngles", "Nose", True)
    assert (failed.ok, failed.error) == (False, "ALMotion: Nose is not a recognized joint name")
    assert rig.ask("listen", "FrontTactilTouched").ok
    # A subscription takes effect a moment after it was sent.
    rig.run_until(
        lambda: (
            robot.say("touch Head/Touch/Front 1") == "ok" and any(isinstance(each, DeviceReport) for each in rig.told)
        )
    )
    (happened, *_) = (each for each in rig.told if isinstance(each, DeviceReport))
    assert (happened.device, happened.what, happened.value) == ("event", "FrontTactilTouched", 1.0)


def read_told(process: subprocess.Popen[str]) -> str:
    """What a client of libqi tells next."""
    assert process.stdout is not None
    return next(line for line in process.stdout if line.startswith("told ")).removeprefix("told ").strip()


def test_a_service_in_another_process_is_called_at_its_own_end_point(rig: Rig, robot: Robot) -> None:
    command = [sys.executable, str(HERE / "libqi_module.py"), f"tcp://{robot.address}"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as module:
        assert module.stdin is not None
        assert read_told(module) == "ready"
        assert rig.ask("call", "mathematics", "add", 2.5, 3.0).value == 5.5
        failed = rig.ask("call", "mathematics", "boom")
        assert (failed.ok, failed.error) == (False, "ValueError: no")
        # And the robot calls it.
        assert robot.say("event tick 7") == "ok"
        assert read_told(module) == "event tick 7.0 text"
        module.stdin.close()
        module.wait(WITHIN_S)
        rig.run_until(lambda: not rig.ask("call", "mathematics", "add", 2.5, 3.0).ok)
        assert rig.ask("call", "ALBattery", "getBatteryCharge").value == 80, "the session goes on"


@pytest.mark.long
def test_a_worker_of_its_own_with_libqi(robot: Robot) -> None:
    told: list[FromWorker] = []
    family = "urbihw_nao.driver:NaoDriver"
    with Worker.start(f"libqi://{robot.address}", post=told.append, family=family) as worker:
        end = time.monotonic() + WITHIN_S
        while not any(isinstance(each, LinkState) and each.up for each in told):
            assert time.monotonic() < end, told
            time.sleep(0.02)
        worker.stop(WITHIN_S)
    assert isinstance(told[-1], Ended) and told[-1].reason == ""


@pytest.mark.parametrize("scheme", ["qi", "libqi"])
def test_a_robot_that_goes_and_comes_back(robot: Robot, scheme: str) -> None:
    told: list[FromWorker] = []
    family = "urbihw_nao.driver:NaoDriver"

    def wait_for(up: bool) -> None:
        end = time.monotonic() + WITHIN_S
        while not any(isinstance(each, LinkState) and each.up == up for each in told):
            assert time.monotonic() < end, told
            time.sleep(0.02)
        told.clear()

    with Worker.start(f"{scheme}://{robot.address}", post=told.append, family=family):
        wait_for(True)
        assert robot.say("unplug") == "ok"
        wait_for(False)
        assert robot.say("plug") == "ok"
        wait_for(True)


def test_libqi_speaks_to_our_nao() -> None:
    with NaoEndpoint(Nao()) as robot:
        robot.start()
        url = robot.url.replace("qi://", "tcp://")
        command = [sys.executable, str(HERE / "libqi_client.py"), url]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        told = [line for line in done.stdout.splitlines() if line.startswith("told ")]
        assert told == [
            "told ALMotion True",
            "told angles [0.0, 0.5]",
            "told awake True",
            "told head 0.5",
            "told walked 0.1",
            "told event 1.0",
            "told error ALMotion: Nose is not a recognized joint name",
        ], done.stdout + done.stderr
