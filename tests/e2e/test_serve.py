"""The real daemon on a real port with a fake robot on a pty, as a user meets it.  Few, and on the real clock."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import starts

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.endpoint import PtyEndpoint

pytestmark = pytest.mark.e2e

TIMEOUT_S = 60.0
"""Seconds after which something that did not happen will not: a busy machine may need many."""
URBIHW = (sys.executable, "-m", "urbihw.cli.main")


class Client:
    """Like telnet: says lines, remembers all it hears."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), TIMEOUT_S)
        self.heard = ""
        self.ended = False

    def say(self, text: str) -> None:
        self._socket.sendall(text.encode() + b"\r\n")

    def listen(self, seconds: float) -> str:
        """What comes within some time."""
        start = len(self.heard)
        self._listen(lambda: False, seconds)
        return self.heard[start:]

    def ask(self, text: str, seconds: float = TIMEOUT_S) -> str:
        """The one line that answers, without its time stamp."""
        start = len(self.heard)
        self.say(text)
        assert self._listen(lambda: "\n" in self.heard[start:], seconds), f"no answer to {text}"
        return self.heard[start:].splitlines()[0].partition("] ")[2]

    def wait(self, text: str, seconds: float = TIMEOUT_S) -> None:
        assert self._listen(lambda: text in self.heard, seconds), f"{text!r} did not come, but: {self.heard}"

    def hear_all(self, pattern: str, count: int) -> list[str]:
        """What comes from now on and matches, at least so many times."""
        start = len(self.heard)
        enough = self._listen(lambda: len(re.findall(pattern, self.heard[start:])) >= count, TIMEOUT_S)
        assert enough, self.heard[start:]
        return re.findall(pattern, self.heard[start:])

    def close(self) -> None:
        self._socket.close()

    def _listen(self, enough: Callable[[], bool], seconds: float) -> bool:
        end = time.monotonic() + seconds
        while not enough() and not self.ended and (left := end - time.monotonic()) > 0:
            self._socket.settimeout(left)
            try:
                data = self._socket.recv(65536)
            except TimeoutError:
                break
            except ConnectionResetError:
                data = b""
            self.ended = not data
            self.heard += data.decode("latin-1")
        return enough()


class Daemon:
    """``urbihw serve`` in a process of its own."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self._port_file = folder / "port"
        self._log = (folder / "log").open("w+")
        self._clients: list[Client] = []
        self.process = starts.Forked(
            (*URBIHW, "serve", "--platform", "bioloid", "--port", "0", "--port-file", str(self._port_file), *arguments),
            stdin=subprocess.DEVNULL,
            stderr=self._log,
        )
        try:
            self.port = self._wait_for_port()
        except BaseException:
            self.close()
            raise

    def _wait_for_port(self) -> int:
        end = time.monotonic() + TIMEOUT_S
        while not (self._port_file.exists() and self._port_file.read_text().endswith("\n")):
            assert self.process.poll() is None and time.monotonic() < end, self.log()
            time.sleep(0.01)
        return int(self._port_file.read_text())

    def client(self) -> Client:
        """One more client."""
        self._clients.append(Client(self.port))
        return self._clients[-1]

    def log(self) -> str:
        self._log.seek(0)
        return self._log.read()

    def link_news(self, before: int = 0) -> list[str]:
        """What the log says of the link, behind its first ``before`` lines."""
        news = self.log().splitlines()[before:]
        return [line for line in news if line.startswith(("urbihw: link lost: ", "urbihw: link to "))]

    def wait_for_link(self, before: int) -> None:
        """Until the link is lost and back, each of which is one line of the log."""
        until(lambda: any(line.startswith("urbihw: link to ") for line in self.link_news(before)), log=self.log)
        lost, back = self.link_news(before)
        assert lost.startswith("urbihw: link lost: ")
        assert back.startswith("urbihw: link to ")

    def close(self) -> None:
        for client in self._clients:
            client.close()
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        self.process.wait(TIMEOUT_S)
        self._log.close()


@pytest.fixture
def robot() -> Iterator[PtyEndpoint]:
    with PtyEndpoint(Bioloid(baud=1_000_000)) as endpoint:
        endpoint.start()
        yield endpoint


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    with contextlib.ExitStack() as stack:
        yield lambda *arguments: stack.enter_context(contextlib.closing(Daemon(tmp_path, *arguments)))


def goal(robot: PtyEndpoint, number: int = 6) -> int:
    kit = robot.device
    assert isinstance(kit, Bioloid)
    return robot.call(lambda: kit.servo(number).registers.get("goal_position"))


def until(done: Callable[[], bool], seconds: float = TIMEOUT_S, log: Callable[[], str] = lambda: "") -> None:
    """Wait for something; ``log`` tells what happened instead."""
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end, f"it did not happen in time {log()}"
        time.sleep(0.02)


def test_the_session_of_the_manual_with_the_built_in_fake(serve: Callable[..., Daemon]) -> None:
    daemon = serve("--fake")
    one, two = daemon.client(), daemon.client()
    one.wait("urbihw")
    until(lambda: one.listen(0.3) == "")
    assert one.heard.count("\n") == 10
    until(lambda: two.listen(0.3) == "")
    began = time.monotonic()
    # Judged in the server: a client on a busy machine may look too late.
    two.say('waituntil(motor6.val > 0.4) | echo(motor6.val < 1.5);')
    one.say("motor6.val = 90deg time:2s; echo(\"there\");")
    two.wait("*** true")
    one.wait("there")
    assert time.monotonic() - began > 1.9
    until(lambda: float(one.ask("motor6.val;")) == pytest.approx(1.571, abs=0.02))
    two.say('at (motor6.val > 0) echo("tick") onleave echo("tack");')
    began = time.monotonic()
    two.say("clock: motor6.val = 0 sin:1s ampli:20deg,")
    heard = two.hear_all("tick|tack", 7)
    assert time.monotonic() - began > 2.5, "twice a second, and not more often"
    assert all(a != b for a, b in zip(heard, heard[1:], strict=False))
    two.say("clock.stop;")
    until(lambda: two.listen(1.0) == "")
    assert two.listen(1.5) == ""


def test_quiet_serves_without_a_banner(serve: Callable[..., Daemon]) -> None:
    daemon = serve("--fake", "--quiet")
    assert daemon.client().ask("1+1;") == "2"


def test_one_silent_servo_and_seventeen_as_before(serve: Callable[..., Daemon], robot: PtyEndpoint) -> None:
    daemon = serve("--url", robot.url, "--quiet")
    client = daemon.client()
    client.say('at (bioloid.lost?(var m)) echo("lost " + m.id.asString) & at (bioloid.back?(var m)) echo("back");')
    # A busy machine may have lost some at the start.
    assert client.ask('for| (var m : motors) while (m.state != "ok") sleep(50ms); "all";').endswith('"all"')
    robot.call(lambda: robot.device.faults.start("silence", 6))
    client.wait("lost 6")
    assert client.ask("motor6.state;") == '"lost"'
    asker = daemon.client()
    client.say("for| (var m : motors) m.val = 20deg;")
    for number in (5, 7, 18):
        place, age = f"motor{number}.val;", f"motor{number}.age;"
        until(lambda: float(asker.ask(place)) == pytest.approx(0.349, abs=0.03))  # noqa: B023
        until(lambda: float(asker.ask(age)) < 0.2)  # noqa: B023
    robot.call(lambda: robot.device.faults.stop())
    client.wait("back")
    until(lambda: daemon.log().count("motor 6 is back") == daemon.log().count("motor 6 is lost") > 0)


def test_the_adapter_pulled_and_put_back_during_the_swing(serve: Callable[..., Daemon], robot: PtyEndpoint) -> None:
    daemon = serve("--url", robot.url, "--quiet")
    client = daemon.client()
    client.say('at (motor6.val > 0) echo("tick") onleave echo("tack");')
    client.say("motor6.val = 0 sin:1s ampli:20deg,")
    asker = daemon.client()
    client.wait("tack")
    before = len(daemon.log().splitlines())
    robot.unplug()
    until(lambda: asker.ask("bioloid.link;") == "false")
    client.listen(1.0)
    robot.plug()
    daemon.wait_for_link(before)
    client.hear_all("tick|tack", 4)
    assert len(daemon.link_news(before)) == 2


NEWS_OF_DEVICES = re.compile(r"urbihw: (?:(\d+) devices are|(?:motor|sensor) \d+ is) (lost|back)")


def test_a_bus_without_power_is_few_lines_and_its_return_as_well(
    serve: Callable[..., Daemon], robot: PtyEndpoint
) -> None:
    daemon = serve("--url", robot.url, "--quiet")
    kit = robot.device
    assert isinstance(kit, Bioloid)
    # A busy machine may have lost some at the start.
    assert daemon.client().ask('for| (var m : motors) while (m.state != "ok") sleep(50ms); sleep(3s); "all";')
    before = len(daemon.log().splitlines())
    robot.call(lambda: kit.power_off(time.monotonic()))

    def told(word: str) -> list[int]:
        """How many devices each line speaks of.  On a busy machine they are not missed all at once."""
        news = [NEWS_OF_DEVICES.match(line) for line in daemon.log().splitlines()[before:]]
        return [int(one[1] or 1) for one in news if one is not None and one[2] == word]

    until(lambda: sum(told("lost")) >= 19, log=daemon.log)
    time.sleep(2.5)
    robot.call(lambda: kit.power_on(time.monotonic()))
    until(lambda: sum(told("back")) == sum(told("lost")), log=daemon.log)
    # All at once in simulated time (tests/platforms/test_device_log.py).
    assert len(told("lost")) < 10
    assert len(told("back")) < 10


def test_a_program_that_exits_ends_the_daemon_in_order(serve: Callable[..., Daemon], robot: PtyEndpoint) -> None:
    daemon = serve("--url", robot.url, "--quiet")
    client, other = daemon.client(), daemon.client()
    before = goal(robot)
    other.say("motor6.speed = 0.5 | motor6.val = 100deg;")
    until(lambda: goal(robot) != before)
    moving = goal(robot)
    client.say("System._exit(5); System._exit(6);")
    assert daemon.process.wait(TIMEOUT_S) == 5
    other.wait("shutting down, the robot is stopped")
    until(lambda: goal(robot) != moving)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_stop_is_clean_and_quick(serve: Callable[..., Daemon], robot: PtyEndpoint, number: signal.Signals) -> None:
    daemon = serve("--url", robot.url, "--quiet")
    client = daemon.client()
    before = goal(robot)
    client.say("motor6.speed = 0.5 | motor6.val = 100deg;")
    until(lambda: goal(robot) != before)
    moving = goal(robot)
    daemon.process.send_signal(number)
    assert daemon.process.wait(TIMEOUT_S) == 0
    # The daemon itself is the clock: it gives up the orderly end after some seconds, and says so.
    assert "ended at once" not in daemon.log()
    client.wait("shutting down")
    until(lambda: goal(robot) != moving)
    kit = robot.device
    assert isinstance(kit, Bioloid)
    assert robot.call(lambda: kit.servo(6).registers.get("torque_enable")) == 1


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_job_that_never_gives_way_does_not_keep_it_from_ending(
    serve: Callable[..., Daemon], robot: PtyEndpoint, number: signal.Signals
) -> None:
    daemon = serve("--url", robot.url, "--quiet")
    client = daemon.client()
    assert client.ask("1;") == "1"
    # What is said is shown when the round is over, which the loop would prevent.
    client.say('echo("busy"); sleep(200ms); loop| {};')
    client.wait("busy")
    time.sleep(0.5)
    daemon.process.send_signal(number)
    assert daemon.process.wait(TIMEOUT_S) == 0


def test_a_killed_daemon_leaves_a_stopped_robot(serve: Callable[..., Daemon], robot: PtyEndpoint) -> None:
    daemon = serve("--url", robot.url, "--quiet")
    client = daemon.client()
    before = goal(robot)
    client.say("motor6.speed = 0.5 | motor6.val = 100deg;")
    until(lambda: goal(robot) != before)
    moving = goal(robot)
    daemon.process.kill()
    until(lambda: goal(robot) != moving)


def test_systemd_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(TIMEOUT_S)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        daemon = Daemon(tmp_path, "--fake", "--quiet")
        try:
            said = ""
            while not re.search(r"STATUS=bioloid: 18 servos, 1 sensor, \d+ Hz", said):
                said += manager.recv(4096).decode() + "\n"
            assert "READY=1" in said
            daemon.process.terminate()
            while "STOPPING=1" not in said:
                said += manager.recv(4096).decode() + "\n"
        finally:
            daemon.close()


def refused(*arguments: str) -> str:
    """The one line with which ``urbihw serve`` refuses to start."""
    done = starts.run((*URBIHW, "serve", *arguments), capture_output=True, text=True, timeout=TIMEOUT_S)
    assert done.returncode == 78
    (line,) = str(done.stderr).splitlines()
    return line


@pytest.mark.long
def test_what_is_wrong_with_the_set_up_is_said_in_one_line(tmp_path: Path) -> None:
    assert "/dev/null is no serial port" in refused("--platform", "bioloid", "--url", "/dev/null", "--port", "0")
    assert f"{tmp_path} is no serial port but a folder" in refused("--platform", "bioloid", "--url", str(tmp_path))
    assert "did you mean baud?" in refused("--platform", "bioloid", "--url", "/dev/ttyNONE?boud=1")
    assert "there are: bioloid" in refused("--platform", "roomba")
    assert "no port" in refused("--platform", "bioloid", "--port", "70000")
    config = tmp_path / "bad.toml"
    config.write_text('platform = "bioloid"\nprot = 1\n')
    assert "bad.toml" in refused("--config", str(config))
    config.write_text('platform = "bioloid"\nfake = true\n[options]\nofset = 3\n')
    assert refused("--config", str(config)) == (
        f"urbihw: {config}: options.ofset: no such option of bioloid; there are: protocol, ids, controller, "
        "fast_read, overspeed, blocked_limit, blocked_action, push"
    )
    config.write_text('platform = "bioloid"\nfake = true\n[limits.moter6]\nspeed = 3\n')
    assert refused("--config", str(config)) == (
        f"urbihw: {config}: limits.moter6: no such device; did you mean motor6?"
    )
    script = tmp_path / "bad.u"
    script.write_text("var x = 1;\nx +;\n")
    config.write_text(f'platform = "bioloid"\nfake = true\nport = 0\nload = ["{script}"]\n')
    assert re.search(r"bad\.u:2\.\d.*syntax error", refused("--config", str(config)))


def test_a_port_in_use_names_who_has_it() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        line = refused("--platform", "bioloid", "--fake", "--port", str(port))
    assert f"port {port} is in use by " in line
    assert f"(process {os.getpid()})" in line


def test_a_robot_in_use_names_who_has_it_and_is_waited_for(
    serve: Callable[..., Daemon], robot: PtyEndpoint, tmp_path: Path
) -> None:
    first = serve("--url", robot.url, "--quiet")
    (tmp_path / "second").mkdir()
    with contextlib.closing(Daemon(tmp_path / "second", "--url", robot.url, "--quiet")) as second:
        line = second.log().splitlines()[0]
        assert re.search(rf"waiting for the robot on {robot.url}: .* is in use by .*\(process \d+\)", line)
        client = second.client()
        assert client.ask("bioloid.link;") == "false"
        # A second one waits until the first one has ended.
        first.close()
        until(lambda: client.ask("bioloid.link;") == "true", log=second.log)


def test_nobody_on_the_bus_and_two_with_one_id(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    with PtyEndpoint(Bioloid(servos=(), sensors=(), baud=1_000_000)) as empty:
        empty.start()
        daemon = serve("--url", empty.url, "--quiet")
        assert f"waiting for the robot on {empty.url}: no servo found" in daemon.log()
        assert daemon.client().ask("bioloid.link;") == "false"
        daemon.close()
    (tmp_path / "port").unlink()
    with PtyEndpoint(Bioloid(units=[Ax12(1), Ax12(3), Ax12(3)], baud=1_000_000)) as crowd:
        crowd.start()
        daemon = serve("--url", crowd.url, "--quiet")
        assert daemon.client().ask("motors.keys;") == "[1]"
        until(lambda: "several devices answer to id 3" in daemon.log())
