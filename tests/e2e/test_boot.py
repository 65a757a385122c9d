"""The daemon at the boot of its machine: the robot comes later, is unplugged, and is replaced by another one.

Real processes on the real clock; few.
"""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_serve import Daemon, until

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.endpoint import PtyEndpoint
from urbihw_fakes.p3dx.kit import P3dx
from urbihw_fakes.spykee.device import Spykee
from urbihw_fakes.spykee.endpoint import SpykeeEndpoint

pytestmark = pytest.mark.e2e

OFF_S = 1.0
"""Seconds for which the robot is still off when clients can connect."""


@pytest.fixture
def serve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Daemon]]:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    with contextlib.ExitStack() as stack:
        yield lambda *arguments: stack.enter_context(contextlib.closing(Daemon(tmp_path, *arguments)))


def kit(*ids: int) -> Bioloid:
    return Bioloid(units=[Ax12(number) for number in ids], baud=1_000_000)


def places(end: PtyEndpoint) -> list[float]:
    """The positions of the servos, as their shafts have them."""
    return end.call(lambda: [unit.position for unit in end.device if isinstance(unit, Ax12)])  # type: ignore[attr-defined]


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        return int(taken.getsockname()[1])


def test_a_bioloid_switched_on_after_the_daemon(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    path = tmp_path / "robot"
    program = tmp_path / "robot.u"
    program.write_text("motor3.load = 1;")
    config = tmp_path / "robot.toml"
    config.write_text(f'load = ["{program}"]\n')
    daemon = serve("--config", str(config), "--url", str(path), "--quiet")
    client = daemon.client()
    assert client.ask("bioloid.link;") == "false"
    assert client.ask("motors.size;") != ""
    client.say('at (bioloid.linkBack?) echo("motors: " + motors.keys);')
    time.sleep(OFF_S)
    with PtyEndpoint(kit(3, 4), str(path)) as end:
        end.start()
        before = places(end)
        client.wait("motors: [3, 4]")
        assert client.ask("bioloid.link;") == "true"
        assert places(end) == before
        lines = daemon.log().splitlines()
        assert lines[0] == f"urbihw: waiting for the robot on {path}: no such port: {path}; is the adapter plugged in?"
        assert "robot.u" in lines[1] and lines[1].endswith("; the robot is not there")
        assert any(line.startswith(f"urbihw: the robot on {path} is here: bioloid: 2 servos") for line in lines)
        daemon.process.terminate()
        assert daemon.process.wait(20) == 0


def test_the_next_start_knows_the_devices_of_the_last_run(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    path, port = tmp_path / "robot", str(free_port())
    with PtyEndpoint(kit(3, 4), str(path)) as end:
        end.start()
        serve("--url", str(path), "--port", port, "--quiet").close()
    (tmp_path / "port").unlink()
    client = serve("--url", str(path), "--port", port, "--quiet").client()
    assert client.ask("[bioloid.link, motors.keys, motor3.stale];") == "[false, [3, 4], true]"


def test_a_pioneer_switched_on_after_the_daemon(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    path = tmp_path / "robot"
    client = serve("--platform", "p3dx", "--url", str(path), "--quiet").client()
    client.say('at (P3dx.linkBack?) echo("here: " + P3dx.model);')
    assert client.ask("P3dx.link;") == "false"
    time.sleep(OFF_S)
    robot = P3dx()
    with PtyEndpoint(robot.robot, str(path)) as end:
        end.start()
        client.wait("here: p3dx-sh")
        assert client.ask("P3dx.body.odometry.x;") == "0"
        assert not end.call(lambda: robot.body.moving)


def test_a_spykee_switched_on_after_the_daemon(serve: Callable[..., Daemon]) -> None:
    port = free_port()
    client = serve("--platform", "spykee", "--url", f"spykee://127.0.0.1:{port}", "--quiet").client()
    client.say('at (Spykee.linkBack?) echo("here");')
    assert client.ask("Spykee.link;") == "false"
    time.sleep(OFF_S)
    with SpykeeEndpoint(Spykee(), port) as end:
        end.start()
        client.wait("here")
        assert client.ask("trackL.val;") == "0"
        assert end.call(lambda: end.device.body.speeds) == [0.0, 0.0]


def test_unplugged_and_another_one_plugged_in(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    path = tmp_path / "robot"
    with PtyEndpoint(kit(3, 4), str(path)) as end:
        end.start()
        daemon = serve("--url", str(path), "--quiet")
        client = daemon.client()
        client.say("motor3.speed = 0.5|; motor3.val = 0 sin:2s ampli:40deg,")
        start = places(end)
        until(lambda: places(end) != start)
    until(lambda: client.ask("bioloid.link;") == "false")
    with PtyEndpoint(kit(13, 14), str(path)) as end:
        end.start()
        before = places(end)
        until(lambda: client.ask("motors.keys;") == "[3, 4, 13, 14]", log=daemon.log)
        client.listen(1)
        assert places(end) == before
        said = "another robot answers: 2 AX-12A (id 13 14, firmware 24), not 2 AX-12A (id 3 4, firmware 24)"
        assert said in daemon.log()


def test_two_robots_swapped(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text('[devices]\nhip = 3\n[devices.knee]\nid = 4\nmodel = "AX-18A"\n')
    with PtyEndpoint(kit(13, 14), str(tmp_path / "robot")) as end:
        end.start()
        daemon = serve("--config", str(config), "--url", str(tmp_path / "robot"), "--quiet")
        client = daemon.client()
        before = places(end)
        client.listen(1)
        assert places(end) == before
        log = daemon.log()
        assert "urbihw: missing: hip (id 3), knee (id 4)\n" in log
        assert "urbihw: unexpected: id 13 (AX-12A, firmware 24), id 14 (AX-12A, firmware 24)\n" in log
