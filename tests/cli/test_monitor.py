"""``urbihw monitor``: lines for a pipe, the table for a terminal; with bus workers that answer what a test says."""

from __future__ import annotations

import copy
import fcntl
import json
import os
import pty
import re
import select
import socket
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from health_sample import HEALTHY
from rich.console import Console
from test_control_commands import Robot

from urbihw.buses.verdict import judge
from urbihw.cli import monitor
from urbihw.cli.reports import Report

pytestmark = pytest.mark.e2e

MONITOR = (sys.executable, "-m", "urbihw.cli.main", "monitor")
TIMEOUT_S = 60.0
LINE = "bioloid-54000: ok: link up, 100 of 100 Hz, wire 40%, 3 late, 900 timeouts"


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """That of a user whose sockets are in a folder of the test."""
    (tmp_path / "urbihw").mkdir(mode=0o700)
    kept = {name: text for name, text in os.environ.items() if name != "RUNTIME_DIRECTORY"}
    return kept | {"XDG_RUNTIME_DIR": str(tmp_path), "TERM": "xterm"}


@pytest.fixture
def robot(environment: dict[str, str], tmp_path: Path) -> Iterator[Robot]:
    made = Robot(tmp_path / "urbihw" / "bioloid-54000.sock", HEALTHY)
    yield made
    made.close()


def moving() -> dict[str, Any]:
    told = copy.deepcopy(HEALTHY)
    told["devices"][0] |= {
        "name": "hip", "requested": {"position": 1.2}, "applied": {"position": 1.0}, "who": "Lobby_2", "missed": 4,
    }  # fmt: skip
    return told


class Screen:
    """``urbihw monitor`` on a terminal."""

    def __init__(self, environment: dict[str, str]) -> None:
        self._end, side = pty.openpty()
        self.resize(30, 120)
        self.process = subprocess.Popen(MONITOR, stdin=side, stdout=side, stderr=side, env=environment)
        os.close(side)
        self.shown = ""

    def resize(self, rows: int, columns: int) -> None:
        fcntl.ioctl(self._end, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def wait(self, pattern: str) -> None:
        """Until the terminal has shown something since the last call."""
        end, self.shown = time.monotonic() + TIMEOUT_S, ""
        while not re.search(pattern, self.shown):
            assert time.monotonic() < end and self.process.poll() is None, self.shown
            if select.select([self._end], [], [], 0.1)[0]:
                self.shown += os.read(self._end, 65536).decode("utf-8", "replace")

    def type(self, text: bytes) -> None:
        os.write(self._end, text)

    def end(self) -> int:
        """The exit code, once it has ended."""
        end = time.monotonic() + TIMEOUT_S
        while self.process.poll() is None and time.monotonic() < end:
            if select.select([self._end], [], [], 0.1)[0]:
                try:
                    os.read(self._end, 65536)
                except OSError:  # the other side is closed
                    break
        return self.process.wait(TIMEOUT_S)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self._end)


def test_a_pipe_gets_lines(environment: dict[str, str], robot: Robot) -> None:
    done = subprocess.run((*MONITOR, "--count", "2"), capture_output=True, text=True, timeout=TIMEOUT_S,
                          env=environment, stdin=subprocess.DEVNULL)  # fmt: skip
    lines = done.stdout.splitlines()
    assert (done.returncode, done.stderr, len(lines)) == (0, "", 2)
    assert all(re.fullmatch(rf"\d\d:\d\d:\d\d {re.escape(LINE)}", line) for line in lines)


def test_a_program_gets_objects(environment: dict[str, str], robot: Robot) -> None:
    done = subprocess.run((*MONITOR, "--count", "1", "--json"), capture_output=True, text=True, timeout=TIMEOUT_S,
                          env=environment, stdin=subprocess.DEVNULL)  # fmt: skip
    (told,) = json.loads(done.stdout).values()
    assert (told["line"], told["devices"][0]["device"]) == (LINE, 6)


def test_a_dumb_terminal_gets_lines(environment: dict[str, str], robot: Robot) -> None:
    screen = Screen(environment | {"TERM": "dumb"})
    try:
        screen.wait(re.escape(LINE))
        assert "\x1b" not in screen.shown
    finally:
        screen.close()


def test_a_bus_worker_that_is_replaced_is_told(environment: dict[str, str], tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as gone:
        gone.bind(str(tmp_path / "urbihw" / "bioloid-54000.sock"))
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as daemon:
        daemon.bind(str(tmp_path / "urbihw" / "urbi-54000.socket"))
        daemon.listen()
        done = subprocess.run((*MONITOR, "--count", "1"), capture_output=True, text=True, timeout=TIMEOUT_S,
                              env=environment, stdin=subprocess.DEVNULL)  # fmt: skip
    told = "bioloid-54000: bad: its bus worker has ended; the daemon is there and starts another one"
    assert done.stdout[9:] == told + "\n"
    done = subprocess.run((*MONITOR, "--count", "1"), capture_output=True, text=True, timeout=TIMEOUT_S,
                          env=environment, stdin=subprocess.DEVNULL)  # fmt: skip
    assert (done.returncode, done.stdout) == (69, "")
    assert "no daemon answers" in done.stderr


def test_a_narrow_terminal_shows_fewer_columns_and_says_which() -> None:
    row = {"device": "shoulder_pan (1)", "model": "STS3215", "state": "ok", "requested": "1.20 rad",
           "applied": "1.00 rad", "measured": "0.50 rad", "temperature": "41 degC", "voltage": "11.1 V", "load": "3%",
           "current": "", "charge": "", "misses": "4/0", "moved by": "Lobby_2"}  # fmt: skip
    assert monitor.columns_for([row], 200) == (
        ["device", "model", "state", "requested", "applied", "measured", "temperature", "voltage", "load", "misses",
         "moved by"], [],
    )  # fmt: skip
    assert monitor.columns_for([row], 60) == (
        ["device", "state", "requested", "measured", "moved by"],
        ["misses", "load", "model", "voltage", "applied", "temperature"],
    )
    assert monitor.columns_for([row], 30) == (["device", "state", "measured"], [
        "misses", "load", "model", "voltage", "applied", "temperature", "moved by", "requested",
    ])  # fmt: skip


def test_requested_stands_beside_applied_and_measured() -> None:
    console = Console(width=140, record=True, file=open(os.devnull, "w"))  # noqa: SIM115
    told = moving()
    console.print(monitor.picture([Report("bioloid-54000", told, "", judge(told))], 140))
    console.file.close()
    lines = console.export_text().splitlines()
    assert lines[0].startswith("bioloid-54000: ok: link up")
    assert lines[1].split() == [
        "device", "model", "state", "requested", "applied", "measured", "temperature", "voltage", "misses", "moved",
        "by",
    ]  # fmt: skip
    assert lines[2].split() == [
        "hip", "(6)", "AX-12A", "ok", "1.20", "rad", "1.00", "rad", "0.50", "rad", "41", "degC", "11.1", "V", "4/0",
        "Lobby_2",
    ]  # fmt: skip


def test_the_table_loses_and_finds_the_daemon_fits_the_terminal_and_ends_with_q(
    environment: dict[str, str], tmp_path: Path
) -> None:
    path = tmp_path / "urbihw" / "bioloid-54000.sock"
    screen = Screen(environment)
    try:
        screen.wait("no daemon answers")
        robot = Robot(path, moving())
        screen.wait("Lobby_2")
        screen.resize(30, 40)
        screen.wait("hip")
        robot.close()
        path.unlink()
        screen.wait("no daemon answers")
        screen.type(b"xq")
        assert screen.end() == 0
    finally:
        screen.close()


def test_without_the_package_one_line_tells_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "rich.live", None)
    for stream in (sys.stdin, sys.stdout):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    from urbihw.cli.main import main

    assert main(("monitor",)) == 78
    line = capsys.readouterr().err
    assert line.startswith("urbihw: the table needs a package: ") and line.count("\n") == 1
