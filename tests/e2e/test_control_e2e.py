"""Stopping from the command line: a real daemon, real commands, and the body of the simulated robot as the judge."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from urbihw import platforms
from urbihw.control_line import ControlLine, question
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.endpoint import PtyEndpoint

from test_serve import TIMEOUT_S, URBIHW, Client, Daemon, until  # isort: skip
import starts

pytestmark = pytest.mark.e2e

RELEASE = f"{sys.executable} -m urbihw.cli.main release"
"""The command as the tests start it."""
ESTOP = f"emergency stop, held until: {RELEASE}"


class Site:
    """A robot, the file of its settings, and the daemons that have served it."""

    def __init__(self, folder: Path, robot: PtyEndpoint) -> None:
        assert isinstance(robot.device, Bioloid)
        self.robot = robot
        self.kit = robot.device
        self.folder = folder
        self.control = folder / "robot.sock"
        self.file = folder / "urbihw.toml"
        self.file.write_text(
            f'platform = "bioloid"\nurl = "{robot.url}"\ncontrol = "{self.control}"\nquiet = true\n'
            "[options]\nprotocol = 1\n"
        )
        self.daemons: list[Daemon] = []

    def serve(self) -> Daemon:
        (self.folder / "port").unlink(missing_ok=True)
        self.daemons.append(Daemon(self.folder, "--config", str(self.file)))
        return self.daemons[-1]

    def urbihw(self, *arguments: str) -> tuple[int, str]:
        """What a command ends with, and the one line that it says."""
        done = starts.run((*URBIHW, *arguments), capture_output=True, text=True, timeout=TIMEOUT_S)
        lines = (done.stdout + done.stderr).splitlines()
        assert len(lines) == 1, lines
        return done.returncode, lines[0]

    def ask(self, verb: str) -> tuple[int, str]:
        """The same, of a command for this robot."""
        return self.urbihw(verb, "--socket", str(self.control), "--who", "a test")

    def direct(self) -> tuple[int, str]:
        return self.urbihw("stop", "--direct", "--config", str(self.file))

    def register(self, name: str, number: int = 6) -> int:
        """What a servo was told, or last told."""
        return self.robot.call(lambda: self.kit.servo(number).registers.get(name))

    def place(self) -> float:
        """Where the body of servo 6 is; it moves also without a request."""

        def look() -> float:
            self.kit.tick(time.monotonic())
            return self.kit.servo(6).position

        return self.robot.call(look)

    def speed(self, number: int) -> float:
        """How fast the body of a servo moves, in positions a second."""

        def look() -> float:
            self.kit.tick(time.monotonic())
            return abs(self.kit.servo(number).speed)

        return self.robot.call(look)

    def stands(self) -> bool:
        """Whether servo 6 is where it stays."""
        before = self.place()
        time.sleep(0.3)
        return abs(self.place() - before) <= 2

    def turn_wheel(self, client: Client) -> None:
        """Let servo 7 turn as a wheel.

        A speed that comes before the limits is that of a joint, which nothing moves; and a busy machine may have lost
        the servo for a moment, when nothing is written.
        """
        until(lambda: client.ask("motor7.state;") == '"ok"')
        client.say("motor7.cwLimit = motor7.ccwLimit = 0|; motor7.speed = 1|;")
        until(lambda: self.speed(7) > 0, log=lambda: client.heard)

    def comes_to_stand(self, far: int) -> None:
        """Wait until servo 6 stands, on a way that leads further."""
        until(self.stands)
        assert self.register("goal_position") != far
        assert abs(self.place() - far) > 20

    def travel(self, client: Client) -> int:
        """Send servo 6 on a long way; where to, when it is well on it."""
        before = self.register("goal_position")
        place = self.place()
        client.say("motor6.speed = 0.15 | motor6.val = 140deg|;")
        until(lambda: self.register("goal_position") != before)
        until(lambda: abs(self.place() - place) > 10)
        return self.register("goal_position")

    def close(self) -> None:
        for daemon in self.daemons:
            for child in children(daemon.process.pid):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)
            daemon.close()


def children(parent: int) -> list[int]:
    """The processes that a process has started and that still live."""
    try:
        text = Path(f"/proc/{parent}/task/{parent}/children").read_text(encoding="ascii")
    except OSError:
        return []
    return [int(word) for word in text.split()]


def kill_all(daemon: Daemon) -> None:
    """Kill a worker and its daemon, so that neither can do anything about it."""
    daemon.process.send_signal(signal.SIGSTOP)
    for child in children(daemon.process.pid):
        os.kill(child, signal.SIGKILL)
    daemon.process.kill()
    daemon.process.wait(TIMEOUT_S)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    kit = Bioloid(baud=1_000_000)
    for unit in kit:
        unit.registers.put("return_delay", 0)
    with PtyEndpoint(kit) as robot:
        robot.start()
        made = Site(tmp_path, robot)
        yield made
        made.close()


def test_stop_estop_and_release(site: Site) -> None:
    client = site.serve().client()
    far = site.travel(client)
    assert site.ask("stop") == (0, "robot: stopped")
    site.comes_to_stand(far)

    far = site.travel(client)
    assert site.ask("estop") == (0, f"robot: {ESTOP}")
    site.comes_to_stand(far)
    place = site.register("goal_position")
    client.say('try { motor6.val = 140deg | "moved" } catch (var e) { "refused" };')
    client.wait('"refused"')
    assert site.register("goal_position") == place
    assert client.ask("bioloid.estop;") == "true"

    assert site.ask("release") == (0, "robot: released")
    time.sleep(0.3)
    assert site.register("goal_position") == place
    assert client.ask("bioloid.estop;") == "false"
    site.travel(client)


def test_without_a_path_the_robot_is_found(site: Site) -> None:
    daemon = Daemon(site.folder, "--url", site.robot.url, "--quiet")
    site.daemons.append(daemon)
    name = f"bioloid-{daemon.port}"
    assert site.urbihw("stop") == (0, f"{name}: stopped")
    assert site.urbihw("estop") == (0, f"{name}: {ESTOP}")
    assert site.urbihw("release") == (0, f"{name}: released")
    daemon.process.terminate()
    assert daemon.process.wait(TIMEOUT_S) == 0
    code, line = site.urbihw("estop")
    assert code == 69 and "no daemon answers" in line


def test_an_emergency_stop_outlives_worker_and_daemon(site: Site) -> None:
    daemon = site.serve()
    client = daemon.client()
    site.travel(client)
    site.ask("estop")
    line = ControlLine(site.control)  # a browser, for which the gateway asks
    line.send(question("estop", "ann", "ann (panel)"))
    assert len(line.next_told(time.monotonic() + TIMEOUT_S)["holders"]) == 2
    line.close()
    (worker,) = children(daemon.process.pid)
    os.kill(worker, signal.SIGKILL)
    until(lambda: children(daemon.process.pid) not in ([], [worker]))
    held = f"robot: stopped; an emergency stop holds (a test and ann) until: {RELEASE}"
    until(lambda: site.ask("stop") == (0, held))
    assert client.ask("bioloid.estop;") == "true"
    kill_all(daemon)
    assert site.direct()[0] == 0
    client = site.serve().client()
    assert client.ask("bioloid.estop;") == "true"
    code, told = site.ask("release")
    assert code == 69 and "your emergency stop is released, but that of ann holds" in told
    code, told = site.ask("release")
    assert code == 69 and "an emergency stop of ann holds" in told
    assert "is held by an emergency stop (ann)" in client.ask("motor6.val = 0;")
    assert site.urbihw("release", "--socket", str(site.control), "--all") == (0, "robot: released")
    site.travel(client)


def test_direct_asks_who_serves_the_robot(site: Site) -> None:
    client = site.serve().client()
    far = site.travel(client)
    assert site.direct() == (0, "robot: stopped")
    site.comes_to_stand(far)


def test_direct_stops_a_robot_whose_daemon_and_worker_were_killed(site: Site) -> None:
    daemon = site.serve()
    far = site.travel(daemon.client())
    kill_all(daemon)
    assert site.register("goal_position") == far
    assert not site.stands()
    assert site.control.exists()
    assert site.direct() == (0, "bioloid: stopped: 6 moved when the link was opened")
    site.comes_to_stand(far)
    assert site.direct() == (0, "bioloid: nothing moved")


def test_direct_stops_wheels(site: Site) -> None:
    daemon = site.serve()
    site.turn_wheel(daemon.client())
    kill_all(daemon)
    assert site.speed(7) > 0
    assert site.direct() == (0, "bioloid: stopped: 7 moved when the link was opened")
    assert site.register("moving_speed", 7) & 1023 == 0


@pytest.mark.long
def test_direct_says_who_has_the_port_and_when_nobody_is_there(site: Site) -> None:
    daemon = Daemon(site.folder, "--url", site.robot.url, "--quiet")
    site.daemons.append(daemon)
    code, line = site.direct()
    assert code == 78 and "is not stopped" in line and "is in use by" in line
    kill_all(daemon)
    site.robot.call(lambda: site.robot.device.faults.start("silence"))
    code, line = site.direct()
    assert code == 69 and "no robot answers" in line
    site.robot.unplug()
    code, line = site.direct()
    assert code == 78 and "no such port" in line


WITH_FAKE = [each for each in platforms.folders() if platforms.read(each).fake]


@pytest.mark.parametrize("folder", WITH_FAKE, ids=lambda folder: folder.name)
def test_direct_knows_every_platform(
    folder: platforms.PlatformFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    name = folder.name
    fake = subprocess.Popen(
        (sys.executable, "-m", "urbihw_fakes", *platforms.read(folder).fake),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    with fake:
        assert fake.stdin is not None and fake.stdout is not None
        url = fake.stdout.readline().decode().strip()
        done = subprocess.run(
            (*URBIHW, "stop", "--direct", "--platform", name, "--url", url),
            capture_output=True, text=True, timeout=TIMEOUT_S,
        )
        fake.stdin.close()
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout in (f"{name}: nothing moved\n", f"{name}: told to stop\n")


# ---------------------------------------------------------------- how long it takes


class Judge:
    """Notes when the robot is told that servo 7 stands."""

    def __init__(self, site: Site) -> None:
        self.at = 0.0
        self._site = site
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look)
        self._thread.start()

    def __enter__(self) -> Judge:
        return self

    def __exit__(self, *failure: object) -> None:
        self._over.set()
        self._thread.join()

    def wait(self) -> float:
        """When it was."""
        self._thread.join()
        assert self.at, "the wheel was not stopped"
        return self.at

    def _look(self) -> None:
        end = time.monotonic() + TIMEOUT_S
        while time.monotonic() < end and not self._over.is_set():
            if self._site.register("moving_speed", 7) & 1023 == 0:
                self.at = time.monotonic()
                return
            time.sleep(0.0005)


def by_socket(site: Site) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as caller:
        caller.connect(str(site.control))
        caller.sendall(b'{"do": "estop", "who": "the red button"}\n')
        assert json.loads(caller.recv(4096))["estop"] == "the red button"


def by_command(site: Site) -> None:
    assert site.ask("estop")[0] == 0


@pytest.mark.parametrize("way", [by_socket, by_command])
def test_an_emergency_stop_is_quick_while_a_client_holds_the_interpreter(
    site: Site, way: Callable[[Site], None]
) -> None:
    # Only the control socket may be what stops it: the dead man is told to wait.
    site.file.write_text("dead_man = 30\n" + site.file.read_text())
    client = site.serve().client()
    site.turn_wheel(client)
    client.say("loop|{},")

    def is_held() -> bool:
        client.say("1;")
        return client.listen(0.5) == ""

    until(is_held)
    with Judge(site) as judge:
        begin = time.monotonic()
        way(site)
        answered = time.monotonic()
        stood = judge.wait()
    print(f"{way.__name__}: the wheel stands after {1000 * (stood - begin):.1f} ms, "
          f"the answer came after {1000 * (answered - begin):.1f} ms", file=sys.stderr)
    time.sleep(0.5)
    assert site.register("moving_speed", 7) & 1023 == 0
