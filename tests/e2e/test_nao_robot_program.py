"""The program on the robot, in a process of its own with a real libqi; the robot and its clients."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import queue
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from faults_lab import Client, Daemon, wait_for
from moving_robots import NAO_WATCHDOG

from urbihw_nao.watchdog import VERSION
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.endpoint import NaoEndpoint

if importlib.util.find_spec("qi") is None:
    pytest.skip("libqi is not there", allow_module_level=True)
pytestmark = pytest.mark.e2e

TIMEOUT_S = 60.0
NAME = "UrbihwWatchdog"


class Robot:
    """A Nao that stands, and the program beside it."""

    def __init__(self, folder: Path) -> None:
        self.device = Nao()
        self.device.body.put_on_feet()
        self.end = NaoEndpoint(self.device)
        self.end.start()
        self._log = (folder / "watchdog.log").open("w+")
        url = self.end.url.replace("qi://", "tcp://")
        command = (sys.executable, str(NAO_WATCHDOG), "--url", url, "--listen", "tcp://127.0.0.1:0")
        self.program = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=self._log, stderr=self._log)
        wait_for(self.is_watched, "the service")

    def is_watched(self) -> bool:
        """Whether the service is there."""
        return any(each.info.name == NAME and each.ready for each in self.device.directory.foreign.values())

    def call(self, method: str, *arguments: Any) -> Any:
        """Call the service, and wait."""
        returned: queue.Queue[Any] = queue.Queue()
        self.end.call(lambda: self.device.directory.call_service(NAME, method, arguments, returned.put))
        return returned.get(timeout=TIMEOUT_S)

    def speed(self) -> float:
        """How fast it walks, m/s."""

        def look() -> float:
            self.device.advance(self.end.clock())
            return self.device.body.walk[0]

        return self.end.call(look)

    def log(self) -> str:
        """What the program has logged."""
        self._log.seek(0)
        return self._log.read()

    def close(self) -> None:
        """End both."""
        self.program.kill()
        self.program.wait(TIMEOUT_S)
        self._log.close()
        self.end.close()


@contextmanager
def watched_robot(folder: Path) -> Iterator[Robot]:
    """A robot, ended."""
    robot = Robot(folder)
    try:
        yield robot
    finally:
        robot.close()


def test_the_program_stops_a_robot_that_is_fed_no_more(tmp_path: Path) -> None:
    with watched_robot(tmp_path) as robot:
        assert (robot.call("version"), robot.call("state")) == (VERSION, "off")
        assert "give more than 0 and up to 10 seconds" in str(robot.call("feed", 11.0))
        robot.end.call(lambda: robot.device.body.drive((0.1, 0.0, 0.0)))
        robot.call("feed", 0.5)
        wait_for(lambda: robot.speed() > 0.05, "a walk")
        wait_for(lambda: robot.speed() == 0.0, "its end")
        wait_for(lambda: robot.call("state") == "stopped", "the last step")
        calls = robot.device.motion.calls
        assert (calls["stopMove"], calls["killAll"], robot.device.body.standing) == (1, 1, True)
        assert "urbihw was not heard in time: the robot is stopped" in robot.log()


def test_the_program_comes_again_when_naoqi_does(tmp_path: Path) -> None:
    with watched_robot(tmp_path) as robot:
        robot.end.unplug()
        wait_for(lambda: "the connection is lost" in robot.log(), "the end of the connection")
        robot.end.plug()
        wait_for(robot.is_watched, "the service")
        robot.program.terminate()
        assert robot.program.wait(TIMEOUT_S) == 0


def test_a_walk_goes_on_with_a_warning_when_the_program_is_killed(tmp_path: Path) -> None:
    with watched_robot(tmp_path) as robot, contextlib.ExitStack() as stack:
        daemon = Daemon(tmp_path, "nao", robot.end.url)
        stack.callback(daemon.close)
        client = Client(daemon.port)
        stack.callback(client.close)
        client.say("naoWalk.xSpeed = 0.1;")
        wait_for(lambda: robot.speed() > 0.08, f"a walk: {client.heard}")
        robot.program.kill()
        wait_for(lambda: "watchdog: feed: " in daemon.log(), f"a warning: {daemon.log()}")
        assert robot.speed() > 0.08
        client.say("robot.stop;")
        wait_for(lambda: robot.speed() == 0.0, "its end")


def test_a_walk_ends_when_urbihw_and_its_worker_are_killed(tmp_path: Path) -> None:
    with watched_robot(tmp_path) as robot, contextlib.ExitStack() as stack:
        daemon = Daemon(tmp_path, "nao", robot.end.url)
        stack.callback(daemon.close)
        client = Client(daemon.port)
        stack.callback(client.close)
        client.say("naoWalk.xSpeed = 0.1;")
        wait_for(lambda: robot.speed() > 0.08, f"a walk: {client.heard}")
        assert robot.call("state") == "fed"
        daemon.process.kill()
        for pid in daemon.workers:
            os.kill(pid, signal.SIGKILL)
        wait_for(lambda: robot.speed() == 0.0, "its end")
        assert robot.device.body.standing
        wait_for(lambda: robot.call("state") == "stopped", "the last step")
