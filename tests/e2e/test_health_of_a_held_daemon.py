"""Health while a program holds the interpreter: a real daemon, real commands, a simulated robot."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.endpoint import PtyEndpoint

from test_serve import TIMEOUT_S, URBIHW, Daemon, until  # isort: skip

pytestmark = pytest.mark.e2e


class Site:
    """A daemon with metrics on a robot of 18 servos."""

    def __init__(self, folder: Path, robot: PtyEndpoint) -> None:
        assert isinstance(robot.device, Bioloid)
        self.robot, self.kit = robot, robot.device
        self.control = folder / "robot.sock"
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.metrics_port = free.getsockname()[1]
        file = folder / "urbihw.toml"
        file.write_text(
            f'platform = "bioloid"\nurl = "{robot.url}"\ncontrol = "{self.control}"\nquiet = true\nhold_limit = 0\n'
            f'metrics = "127.0.0.1:{self.metrics_port}"\n[options]\nprotocol = 1\n'
        )
        self.daemon = Daemon(folder, "--config", str(file))

    def urbihw(self, *arguments: str) -> tuple[int, str]:
        done = subprocess.run((*URBIHW, *arguments, "--socket", str(self.control)), capture_output=True, text=True,
                              timeout=TIMEOUT_S)  # fmt: skip
        assert done.stderr == ""
        return done.returncode, done.stdout

    def kinds(self) -> set[tuple[str, str]]:
        """The reasons of the verdict: kind and device."""
        _, told = self.urbihw("health", "--json")
        return {(row["kind"], row["device"]) for row in json.loads(told)["robot"]["reasons"]}

    def scrape(self) -> str:
        asked = http.client.HTTPConnection("127.0.0.1", self.metrics_port, timeout=TIMEOUT_S)
        with contextlib.closing(asked):
            asked.request("GET", "/metrics")
            answer = asked.getresponse()
            assert answer.status == 200
            return answer.read().decode()


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with PtyEndpoint(Bioloid(sensors=(), baud=1_000_000)) as robot:
        robot.start()
        made = Site(tmp_path, robot)
        yield made
        made.daemon.close()


def test_it_is_judged_and_measured_while_a_program_holds_the_interpreter(site: Site) -> None:
    client = site.daemon.client()
    client.say("motor7.speed = 0; motor6.val = 0.3;")
    until(lambda: "moved by Lobby_" in site.urbihw("status")[1], log=site.daemon.log)
    code, told = site.urbihw("status")
    (line,) = [line for line in told.splitlines() if line.startswith("  6 AX-12A: ok, ")]
    assert code == 0 and "degC" in line and " V, " in line and "(127.0.0.1)" in line
    assert len(told.splitlines()) == 19
    client.say("loop|{};")
    until(lambda: ("dead_man", "") in site.kinds(), log=site.daemon.log)
    assert site.urbihw("health")[0] == 2
    site.robot.call(lambda: site.kit.faults.start("silence", 9))
    until(lambda: ("lost", "9") in site.kinds(), log=site.daemon.log)
    until(lambda: 'urbihw_device_up{robot="robot",device="9",name="",model="AX-12A"} 0' in site.scrape())
    assert 'urbihw_device_up{robot="robot",device="6",name="",model="AX-12A"} 1' in site.scrape()
    assert 'urbihw_health{robot="robot"} 2' in site.scrape()
