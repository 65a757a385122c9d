"""The real daemon with a simulated Spykee on real TCP and UDP, as a user meets it.  Few, and on the real clock."""

from __future__ import annotations

import contextlib
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_serve import Daemon, until

from urbihw.buses import open_link
from urbihw.buses.errors import Unavailable
from urbihw.buses.messages import Configure
from urbihw.platforms.spykee.discovery import search
from urbihw.platforms.spykee.driver import SpykeeDriver
from urbihw_fakes.spykee.device import Spykee
from urbihw_fakes.spykee.endpoint import SpykeeEndpoint

pytestmark = pytest.mark.e2e


@pytest.fixture
def end() -> Iterator[SpykeeEndpoint]:
    with SpykeeEndpoint(Spykee()) as made:
        made.start()
        yield made


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    with contextlib.ExitStack() as stack:
        yield lambda *arguments: stack.enter_context(
            contextlib.closing(Daemon(tmp_path, "--platform", "spykee", "--quiet", *arguments))
        )


def speed(end: SpykeeEndpoint) -> float:
    def look() -> float:
        end.device.body.advance(end.clock())
        return end.device.body.speeds[0]

    return end.call(look)


def test_it_is_found_driven_and_stopped_with_its_client(serve: Callable[..., Daemon], end: SpykeeEndpoint) -> None:
    daemon = serve("--url", f"spykee://?discovery={end.port}")
    client = daemon.client()
    assert client.ask("trackL.val = 50;") == "50"
    until(lambda: speed(end) > 0.15)
    client.ask("camera.val.keywords;")
    until(lambda: client.ask("camera.val.keywords;") == '"jpeg 320 240"')
    assert speed(end) > 0.15
    client.close()
    until(lambda: speed(end) == 0.0, 5)
    until(lambda: "is closed, which moved it" in daemon.log())


def test_several_are_named_and_none_is_taken(end: SpykeeEndpoint) -> None:
    with SpykeeEndpoint(Spykee("SPYKEEtwo"), end.port, address="127.0.0.2") as other:
        other.start()
        found = {robot.uid: robot.address for robot in search(end.port, 0.7)}
        assert found == {"SPYKEE0011223344": f"127.0.0.1:{end.port}", "SPYKEEtwo": f"127.0.0.2:{end.port}"}
        with pytest.raises(Unavailable, match="2 Spykees answer: say which one by its url: spykee://") as caught:
            open_link(f"spykee://?discovery={end.port}")
        assert "SPYKEEtwo" in str(caught.value)
    with open_link(f"spykee://?discovery={end.port}") as link:
        assert link.is_open


def test_nobody_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as free, pytest.raises(Unavailable, match="no Spykee answers"):
        open_link(f"spykee://?discovery={free.getsockname()[1]}")


def test_scan_is_a_command() -> None:
    done = subprocess.run(
        (sys.executable, "-m", "urbihw.cli.main", "scan", "bioloid"), capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (
        78, "urbihw: a bioloid cannot be looked for on the network; name its port: --url\n"
    )  # fmt: skip


def test_a_second_user_is_refused_while_the_first_has_the_robot(end: SpykeeEndpoint) -> None:
    with socket.create_connection(("127.0.0.1", end.port)) as first:
        first.sendall(b"PK\x0a\x00\x0c\x05admin\x05admin")
        assert first.recv(5)[:3] == b"PK\x0b"
        with socket.create_connection(("127.0.0.1", end.port)) as second:
            second.sendall(b"PK\x0a\x00\x0c\x05admin\x05admin")
            data = b""
            while more := second.recv(100):
                data += more
            assert data[:3] == b"PK\x0b" and len(data) < 5 + 8
        with open_link(end.url) as third, pytest.raises(Unavailable, match="or somebody else is connected"):
            driver = SpykeeDriver()
            driver.configure(Configure())
            driver.attach(third)
        (robot,) = search(end.port, 0.3)
        assert robot.user == "admin"


def test_a_direct_stop_stops_it_and_does_not_say_that_nothing_moved(end: SpykeeEndpoint) -> None:
    end.call(lambda: end.device.body.drive(60, 60))
    until(lambda: speed(end) > 0.2)
    command = (sys.executable, "-m", "urbihw.cli.main", "stop", "--direct", "--platform", "spykee", "--url", end.url)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "spykee: told to stop\n", "")
    until(lambda: speed(end) == 0.0)


def test_bulk_data_does_not_pile_up_in_front_of_a_stop(end: SpykeeEndpoint) -> None:
    """A robot that reads nothing: few bytes are taken for it, and the link says so."""
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        with open_link(f"spykee://127.0.0.1:{deaf.getsockname()[1]}") as link:
            sent = 0
            while link.is_writable() and sent < 5_000_000:
                link.write(bytes(4096))
                sent += 4096
            assert sent < 5_000_000


def test_a_cut_network_is_noticed_soon() -> None:
    alone = ("unshare", "--map-root-user", "--net")
    if shutil.which("ip") is None or shutil.which("unshare") is None or subprocess.run((*alone, "true")).returncode:
        pytest.skip("a network of its own cannot be made here")
    script = str(Path(__file__).with_name("spykee_cut.py"))
    done = subprocess.run((*alone, sys.executable, script), capture_output=True, text=True, check=True)
    assert float(done.stdout) < 4.0
