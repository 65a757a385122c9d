"""Services of clients at the simulated Nao: registered, called, and gone, with a real libqi as the client."""

from __future__ import annotations

import importlib.util
import queue
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from faults_lab import wait_for

from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.endpoint import NaoEndpoint

if importlib.util.find_spec("qi") is None:
    pytest.skip("libqi is not there", allow_module_level=True)
pytestmark = pytest.mark.e2e

HERE = Path(__file__).parent
TIMEOUT_S = 60.0


class Client:
    """A process of a real libqi, and what it has told."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, str(HERE / "libqi_module.py"), *arguments]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._told: queue.Queue[str] = queue.Queue()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith("told "):  # libqi logs to the standard output, too
                self._told.put(line.removeprefix("told ").strip())

    def read(self) -> str:
        """What it tells next."""
        return self._told.get(timeout=TIMEOUT_S)

    def say(self, text: str) -> None:
        """A line."""
        assert self.process.stdin is not None
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()

    def close(self) -> None:
        """End it."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        self.process.wait(TIMEOUT_S)
        self._thread.join(TIMEOUT_S)
        self.process.stdout.close()


class Robot:
    """A Nao, and calls of it to its clients."""

    def __init__(self) -> None:
        self.device = Nao()
        self.end = NaoEndpoint(self.device)
        self.end.start()
        self.url = self.end.url.replace("qi://", "tcp://")

    def call(self, method: str, *arguments: Any) -> Any:
        """Call the service of the client, and wait; a `Failed` is returned, too."""
        returned: queue.Queue[Any] = queue.Queue()
        self.end.call(lambda: self.device.directory.call_service("mathematics", method, arguments, returned.put))
        return returned.get(timeout=TIMEOUT_S)


@contextmanager
def robot_and_client(*endpoints: str) -> Iterator[tuple[Robot, Client]]:
    """Both, the client ready."""
    robot = Robot()
    with robot.end:
        client = Client(robot.url, *endpoints)
        try:
            assert client.read() == "ready"
            yield robot, client
        finally:
            client.close()


@pytest.mark.parametrize("endpoints", [(), ("tcp://127.0.0.1:0",)])
def test_the_robot_calls_a_service_of_libqi(endpoints: tuple[str, ...]) -> None:
    with robot_and_client(*endpoints) as (robot, client):
        assert robot.call("add", 2, 3) == 5
        assert robot.call("add", "a", "b") == "ab"
        assert "ValueError: no" in str(robot.call("boom"))
        assert str(robot.call("add", 1)) == "mathematics has no method add for 1 such values"
        robot.end.call(lambda: robot.device.memory.raise_event("tick", 7))
        assert client.read() == "event tick 7 text"
        client.say("leave")
        assert client.read() == "left"
        assert str(robot.call("add", 2, 3)) == "Cannot find service 'mathematics' in index"


def test_the_services_of_a_client_that_is_killed_are_gone() -> None:
    with robot_and_client() as (robot, client):
        assert robot.call("add", 2, 3) == 5
        client.process.kill()
        wait_for(lambda: not robot.device.directory.foreign, "the service to be gone")
        assert str(robot.call("add", 2, 3)) == "Cannot find service 'mathematics' in index"


def test_another_client_finds_a_service_and_hears_of_it() -> None:
    qi = importlib.import_module("qi")
    robot = Robot()
    with robot.end:
        session = qi.Session()
        session.connect(robot.url)
        heard: queue.Queue[Any] = queue.Queue()
        try:
            session.serviceRegistered.connect(lambda number, name: heard.put(name))
            session.serviceUnregistered.connect(lambda number, name: heard.put(name))
            client = Client(robot.url)
            try:
                assert client.read() == "ready"
                assert heard.get(timeout=TIMEOUT_S) == "mathematics"
                assert session.service("mathematics").add(2, 3) == 5
            finally:
                client.close()
            assert heard.get(timeout=TIMEOUT_S) == "mathematics"
        finally:
            session.close()
