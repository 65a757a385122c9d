"""Modules of a real daemon, called by a real libqi and by a web client.  Few, and on the real clock."""

from __future__ import annotations

import contextlib
import http.client
import importlib.util
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_serve import Daemon, until

from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.endpoint import NaoEndpoint
from urbihw_nao_fakes.tls import Identity

pytestmark = pytest.mark.e2e

HERE = Path(__file__).parent
PROGRAM = (
    'var Global.mathematics = ALModule.new("mathematics")|; function mathematics.add(a, b) { return a + b }|;'
    ' mathematics.setModuleDescription("sums"); function mathematics.hang() { loop| {} }|;'
    ' mathematics.bindUrbiMethod("add", "the sum", [["a", "one"], ["b", "other"]], ["sum", "the sum"]);'
    ' mathematics.bindUrbiMethod("hang", "for ever", [], []);'
)


@pytest.fixture
def end() -> Iterator[NaoEndpoint]:
    """A Nao on the network."""
    with NaoEndpoint(Nao()) as made:
        made.start()
        yield made


@pytest.fixture
def serve(tmp_path: Path, end: NaoEndpoint) -> Iterator[Callable[..., Daemon]]:
    """Starts a daemon for it, whose module is there."""
    with contextlib.ExitStack() as stack:

        def start(*arguments: str, robot: NaoEndpoint = end) -> Daemon:
            daemon = Daemon(tmp_path, "--platform", "nao", "--quiet", "--url", robot.url, *arguments)
            stack.enter_context(contextlib.closing(daemon))
            client = daemon.client()
            client.say(PROGRAM)
            until(lambda: names(robot) == ["mathematics"])
            assert client.ask('echo("ready");') == "*** ready"
            return daemon

        yield start


def libqi(*arguments: str) -> list[str]:
    """What the client of libqi tells."""
    command = [sys.executable, str(HERE / "nao_module_client.py"), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return [line.removeprefix("told ") for line in done.stdout.splitlines() if line.startswith("told ")]


def names(end: NaoEndpoint) -> list[str]:
    """The modules in the robot's directory."""
    return end.call(lambda: [each.info.name for each in end.device.directory.foreign.values() if each.ready])


@pytest.mark.skipif(importlib.util.find_spec("qi") is None, reason="libqi is not there")
def test_libqi_calls_a_module(serve: Callable[..., Daemon], end: NaoEndpoint) -> None:
    daemon = serve()
    told = libqi(end.url.replace("qi://", "tcp://"))
    assert told[:6] == [
        "sum 5.0 ab [1.0, True]",
        "ping True",
        "help ['add', 'the sum', [['a', 'one'], ['b', 'other']], 'sum: the sum']",
        "meta sums the sum ['a', 'b']",
        f"many {[float(number) for number in range(1, 11)]}",
        "error unexpected [] for argument 1, expected a Float",
    ]
    assert told[6] == "error exit: mathematics belongs to urbihw, and is ended there"
    # A method that never gives way is ended as any program is.
    assert told[7:] == ["error held the interpreter for more than 0.5 s: give way with ';' or sleep"]
    assert daemon.client().ask("1 + 1;") == "2"


def test_over_tls_only_the_robot_calls(serve: Callable[..., Daemon]) -> None:
    with NaoEndpoint(Nao(), identity=Identity()) as robot:
        robot.start()
        serve(robot=robot)
        values: list[object] = []
        services = robot.device.directory
        assert robot.call(lambda: [each.info.endpoints for each in services.foreign.values()]) == [[]]
        robot.call(lambda: services.call_service("mathematics", "add", (2, 3), values.append))
        until(lambda: bool(values))
        assert values == [5.0]


def test_a_killed_daemon_frees_its_modules(serve: Callable[..., Daemon], end: NaoEndpoint) -> None:
    daemon = serve()
    daemon.process.kill()
    until(lambda: names(end) == [])


def test_a_web_client_calls_a_module(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    settings = tmp_path / "urbihw.toml"
    settings.write_text(f"[options]\nmodule_http_port = {port}\n")
    serve("--config", str(settings))

    def get(**headers: str) -> tuple[int, str]:
        link = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
        with contextlib.closing(link):
            link.request("GET", "/?eval=mathematics.add(2,3)", headers=headers)
            answer = link.getresponse()
            return answer.status, answer.read().decode()

    assert get() == (200, "<HTML><BODY><PRE>5</PRE></BODY></HTML>\n")
    assert get(Origin="https://evil.example")[0] == 403
