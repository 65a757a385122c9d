"""The real daemon with a simulated TriBot on USB and behind a serial line, as a user meets it.  On the real clock."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_serve import TIMEOUT_S, Daemon, until

from urbihw_fakes.endpoint import PtyEndpoint
from urbihw_fakes.nxt.stream import NxtDevice
from urbihw_fakes.nxt.tribot import TriBot
from urbihw_fakes.nxt.usb_endpoint import UsbEndpoint
from urbihw_fakes.serving import Endpoint

pytestmark = pytest.mark.e2e

DISTANCE = 1.0


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    with contextlib.ExitStack() as stack:
        yield lambda *arguments: stack.enter_context(
            contextlib.closing(Daemon(tmp_path, "--platform", "nxt", "--quiet", *arguments))
        )


@pytest.fixture
def usb() -> Iterator[Endpoint]:
    with UsbEndpoint(NxtDevice(TriBot(DISTANCE))) as endpoint:
        endpoint.start()
        yield endpoint


@pytest.fixture(params=["usb", "pty"])
def end(request: pytest.FixtureRequest) -> Iterator[Endpoint]:
    device = NxtDevice(TriBot(DISTANCE))
    with UsbEndpoint(device) if request.param == "usb" else PtyEndpoint(device) as endpoint:
        endpoint.start()
        yield endpoint


def robot_of(end: Endpoint) -> TriBot:
    device = end.device
    assert isinstance(device, NxtDevice)
    return device.robot


def powers(end: Endpoint) -> list[int]:
    return end.call(lambda: [motor.power for motor in robot_of(end).brick.motors])


def test_at_sonar_stops_the_robot_that_drives_to_the_wall(serve: Callable[..., Daemon], end: Endpoint) -> None:
    client = serve("--url", end.url).client()
    client.say("at (sonar.val < 50)\r\n  wheels.speed = 0;")
    client.say("wheels.speed = 50|;")
    until(lambda: client.ask("sonar.val < 50;") == "true")
    until(lambda: powers(end) == [0, 0, 0])
    end.call(lambda: end.device.tick(end.clock()))
    # 22 cm/s, on a machine that may have other things to do.
    assert 0.1 < robot_of(end).distance() < 0.5


def test_it_comes_with_a_robot_in_software(serve: Callable[..., Daemon]) -> None:
    daemon = serve("--fake")
    client = daemon.client()
    assert client.ask("nxt.url[0, 6];") == '"usb://"'
    assert client.ask("sonar.val;") == "150"
    assert client.ask('load("demo.u")| wheelL.speed;') == "40"
    assert '"NXT", 3 motors, 4 sensors' in daemon.log()


def test_beeps_follow_the_distance(serve: Callable[..., Daemon], usb: Endpoint) -> None:
    client = serve("--url", usb.url).client()
    sound = robot_of(usb).brick.sound
    client.say("var mytag = Tag.new;")
    client.say("mytag: whenever (sonar.val < 100)\r\n  beeper.play(200 + 6 * sonar.val, 3ms),")
    for centimetres in (80, 40):
        usb.call(lambda: setattr(robot_of(usb), "obstacle", centimetres / 100))  # noqa: B023
        until(lambda: sound.frequency == 200 + 6 * centimetres)  # noqa: B023
    played = sound.played
    until(lambda: sound.played > played + 20)
    client.say('mytag.stop; echo("stopped");')
    client.wait("stopped")
    client.listen(1.0)
    played = sound.played
    client.listen(0.3)
    assert sound.played == played


def test_the_cable_pulled_and_put_back_during_a_behaviour(serve: Callable[..., Daemon], usb: Endpoint) -> None:
    daemon = serve("--url", usb.url)
    client = daemon.client()
    client.say("claw.speed = 0 sin:2s ampli:50,")
    until(lambda: powers(usb)[1] > 20)
    before = len(daemon.log().splitlines())
    usb.unplug()
    until(lambda: client.ask("nxt.link;") == "false")
    usb.plug()
    daemon.wait_for_link(before)
    until(lambda: powers(usb)[1] > 20)
    until(lambda: powers(usb)[1] < -20)
    assert len(daemon.link_news(before)) == 2


def test_the_robot_killed_and_started_again_during_a_behaviour(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    bus = str(tmp_path / "bus")

    def start() -> subprocess.Popen[str]:
        fake = (sys.executable, "-m", "urbihw_fakes", "nxt", "--usb", bus)
        process = subprocess.Popen(fake, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        url.append(process.stdout.readline().strip())
        process.stdout.close()
        return process

    url: list[str] = []
    robot = start()
    try:
        daemon = serve("--url", url[0])
        client = daemon.client()
        client.say('every (200ms) { if (bumper.stale) echo("blind") else echo("sees") },')
        client.wait("sees")
        before = len(daemon.log().splitlines())
        robot.kill()
        robot.wait(TIMEOUT_S)
        client.wait("blind")
        robot = start()
        daemon.wait_for_link(before)
        until(lambda: "sees" in client.listen(0.3))
        assert len(daemon.link_news(before)) == 2
    finally:
        robot.kill()
        robot.wait(TIMEOUT_S)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_motors_stand_when_the_daemon_ends(serve: Callable[..., Daemon], usb: Endpoint, number: signal.Signals) -> None:
    daemon = serve("--url", usb.url)
    daemon.client().say("wheels.speed = 30; claw.val = 100000; beeper.play(300, 0);")
    until(lambda: powers(usb)[0] == 30 and powers(usb)[1] > 0)
    daemon.process.send_signal(number)
    daemon.process.wait(TIMEOUT_S)
    until(lambda: powers(usb) == [0, 0, 0])
    until(lambda: not robot_of(usb).brick.sound.sounding(usb.clock()))


def test_a_script_that_never_yields_does_not_keep_the_robot_going(
    serve: Callable[..., Daemon], usb: Endpoint, tmp_path: Path
) -> None:
    """The dead man's work, where ``hold_limit`` does not end the script before."""
    settings = tmp_path / "settings.toml"
    settings.write_text("hold_limit = 0\n")
    client = serve("--url", usb.url, "--config", str(settings)).client()
    client.say("wheels.speed = 30;")
    until(lambda: powers(usb)[0] == 30)
    client.say("var n = 0| while| (true) n++;")
    until(lambda: powers(usb) == [0, 0, 0])


def test_a_brick_that_is_absent_or_in_use_is_waited_for_and_told_in_one_line(
    serve: Callable[..., Daemon], usb: Endpoint, tmp_path: Path
) -> None:
    def waits_for(url: str) -> str:
        (tmp_path / "port").unlink(missing_ok=True)
        daemon = serve("--url", url)
        line = daemon.log().splitlines()[0]
        daemon.close()
        return line

    (tmp_path / "none").mkdir()
    empty = f"usb://0694:0002?backend=urbihw_fakes.nxt.usb_backend:bus&at={tmp_path / 'none'}"
    assert "waiting for the robot" in (line := waits_for(empty)) and "no USB device 0694:0002; is it plugged in" in line
    assert "waiting for the robot on /dev/rfcomm77: no such port" in waits_for("/dev/rfcomm77")
    owner = serve("--url", usb.url)
    until(lambda: "3 motors" in owner.log())
    assert "in use by another program" in waits_for(usb.url)
