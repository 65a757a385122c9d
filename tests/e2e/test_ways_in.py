"""The daemon's ways in: its UNIX socket, and a port that takes connections only when there is somebody to answer."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import starts

pytestmark = pytest.mark.e2e

TIMEOUT_S = 60.0


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        return int(taken.getsockname()[1])


class Daemon:
    """``urbihw serve`` with a simulated robot."""

    def __init__(self, folder: Path, settings: str = "") -> None:
        self.port = free_port()
        self.folder = folder / "runtime"
        self.log = folder / "log"
        file = folder / "robot.toml"
        file.write_text(f'platform = "bioloid"\nfake = true\nquiet = true\nport = {self.port}\n{settings}\n')
        environment = {**os.environ, "XDG_RUNTIME_DIR": str(self.folder)}
        self.folder.mkdir(mode=0o700)
        with self.log.open("w") as log:
            self.process = starts.Forked(
                (sys.executable, "-m", "urbihw.cli.main", "serve", "--config", str(file)),
                stdin=subprocess.DEVNULL,
                stderr=log,
                env=environment,
            )

    @property
    def path(self) -> Path:
        """Where its UNIX socket should be."""
        return self.folder / "urbihw" / f"urbi-{self.port}.socket"

    def connect(self, path: Path | None = None) -> socket.socket:
        """A connection as soon as there can be one, by TCP or a path."""
        end = time.monotonic() + TIMEOUT_S
        while True:
            made = socket.socket(socket.AF_UNIX if path else socket.AF_INET)
            made.settimeout(TIMEOUT_S)
            try:
                made.connect(str(path) if path else ("127.0.0.1", self.port))
                return made
            except OSError:
                made.close()
                assert self.process.poll() is None and time.monotonic() < end, self.log.read_text()
                time.sleep(0.001)

    def stop(self) -> int:
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(TIMEOUT_S)

    def close(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        self.process.wait(TIMEOUT_S)


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Daemon]:
    made = Daemon(tmp_path)
    yield made
    made.close()


def ask(client: socket.socket, text: str) -> str:
    """The line that answers."""
    client.sendall(text.encode())
    heard = b""
    while not heard.endswith(b"\n"):
        data = client.recv(4096)
        assert data, "hung up"
        heard += data
    return heard.decode().partition("] ")[2].strip()


def test_whoever_gets_through_is_answered(daemon: Daemon) -> None:
    """A port that listens before the robot is found, only to be closed again, would take this client and drop it."""
    with daemon.connect() as client:
        assert ask(client, "1 + 1;") == "2"
    assert daemon.stop() == 0


def test_the_unix_socket_serves_user_and_group_and_goes_with_the_daemon(daemon: Daemon) -> None:
    with daemon.connect(daemon.path) as client:
        assert ask(client, "1 + 1;") == "2"
        assert ask(client, 'lobby.hasLocalSlot("remoteIP");') == "false"
        about = daemon.path.stat()
        assert stat.S_ISSOCK(about.st_mode) and stat.S_IMODE(about.st_mode) == 0o660
        client.sendall(b'sleep(100ms); echo("late");')
        client.shutdown(socket.SHUT_WR)
        heard = b""
        while data := client.recv(4096):
            heard += data
        assert heard.endswith(b"*** late\n")
    with daemon.connect(daemon.path) as client:
        client.sendall(b"POST / HTTP/1.1\r\n")
        assert client.recv(4096).startswith(b"HTTP/1.1 400")
    assert f"of process {os.getpid()}" not in daemon.log.read_text()
    assert f"client process {os.getpid()} of user {os.getuid()} refused: it speaks HTTP" in daemon.log.read_text()
    assert daemon.stop() == 0
    assert not daemon.path.exists()


def test_what_a_killed_daemon_left_is_replaced_and_what_lives_is_not(tmp_path: Path) -> None:
    path = tmp_path / "robot.socket"
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(path))
    with contextlib.closing(Daemon(tmp_path, f'socket = "{path}"')) as daemon:
        with daemon.connect(path) as client:
            assert ask(client, "1 + 1;") == "2"
        (tmp_path / "other").mkdir()
        with contextlib.closing(Daemon(tmp_path / "other", f'socket = "{path}"')) as second:
            assert second.process.wait(TIMEOUT_S) == 78
            assert second.log.read_text() == (
                f"urbihw: socket: cannot listen at {path}: somebody listens there; choose another path\n"
            )
        with daemon.connect(path) as client:
            assert ask(client, "1 + 1;") == "2"


def test_there_need_not_be_one(tmp_path: Path) -> None:
    with contextlib.closing(Daemon(tmp_path, 'socket = "off"\nmax_clients = 2')) as daemon:
        with daemon.connect() as one, daemon.connect() as two, daemon.connect() as three:
            assert ask(one, "1 + 1;") == ask(two, "1 + 1;") == "2"
            assert three.recv(100) == b"*** urbihw: too many connections (2); close one, or raise max_clients\n"
        assert not daemon.path.exists()


def test_what_is_no_socket_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "precious"
    path.write_text("x")
    with contextlib.closing(Daemon(tmp_path, f'socket = "{path}"')) as daemon:
        assert daemon.process.wait(TIMEOUT_S) == 78
        assert "something else than a socket is there" in daemon.log.read_text()
    assert path.read_text() == "x"


# ---------------------------------------------------------------- who moves the robot


@pytest.mark.parametrize("how", ["close", "half close"])
def test_what_a_client_moves_stops_when_it_can_say_nothing_more(daemon: Daemon, how: str) -> None:
    with daemon.connect() as watcher, daemon.connect() as mover:
        mover.sendall(b"motor6.val = 0; sleep(1s); motor6.val = 0 sin:400ms ampli:20deg, sleep(1h);\n")
        end = time.monotonic() + TIMEOUT_S
        while ask(watcher, "motor6.val.abs > 0.1;") != "true":
            assert time.monotonic() < end
        if how == "close":
            mover.close()
        else:
            mover.shutdown(socket.SHUT_WR)
        while "the connection of" not in daemon.log.read_text():
            assert time.monotonic() < end
            time.sleep(0.01)
        time.sleep(0.5)
        held = ask(watcher, "motor6.val;")
        time.sleep(0.3)
        assert abs(float(ask(watcher, "motor6.val;")) - float(held)) < 0.01


def test_a_statement_that_outlives_the_sending_side_moves_nothing(daemon: Daemon) -> None:
    with daemon.connect() as client:
        client.sendall(b'sleep(300ms); motor6.val = 0.5; echo("done");\n')
        client.shutdown(socket.SHUT_WR)
        heard = b""
        while data := client.recv(4096):
            heard += data
        lines = heard.decode().splitlines()
        assert "is closed on its side, so it cannot move" in lines[0]
        assert lines[-1].endswith("*** done")
