"""``urbihw drive`` at a terminal: what the body of a simulated robot does with keys, and when things break."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from faults_lab import Case, case_of, wait_for
from moving_robots import RIGS
from programs_lab import Terminal

pytestmark = pytest.mark.e2e

SEGWAY, P3DX, SPYKEE = (next(rig for rig in RIGS if rig.platform == name) for name in ("segway", "p3dx", "spykee"))
STILL_S = 1.0
MOVING = 0.1


class SlowNetwork:
    """A network before a port: while ``stalled`` is set, it keeps what is sent, and the end of a connection, too."""

    def __init__(self, port: int) -> None:
        self.stalled = threading.Event()
        self._server = port
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        threading.Thread(target=self._carry, daemon=True).start()

    def _carry(self) -> None:
        with self._listening, contextlib.suppress(OSError):
            near, _ = self._listening.accept()
            with near, socket.create_connection(("127.0.0.1", self._server)) as far:
                while True:
                    ready, _, _ = select.select([near, far], [], [], 0.05)
                    while self.stalled.is_set():
                        time.sleep(0.02)
                    for one, other in ((near, far), (far, near)):
                        if one in ready:
                            data = one.recv(65536)
                            if not data:
                                return
                            other.sendall(data)


class Drive:
    """``urbihw drive`` before a robot; keys repeat as those of a terminal do."""

    def __init__(self, case: Case, folder: Path, port: int | None = None) -> None:
        self.case = case
        self.terminal = Terminal("main", "drive", f":{port or case.daemon.port}", cwd=folder)
        self.terminal.wait("q, Ctrl-C +leave")
        self.terminal.wait("ordered")

    def hold(self, key: str, seconds: float) -> None:
        """Hold a key: it repeats 25 times in a second."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.terminal.type(key)
            self.terminal.listen(0.04)

    def hold_until_it_moves(self, key: str = "w") -> None:
        """Hold a key until the body moves; a daemon on a busy machine is stopped by its dead man, which holds until the
        key is released."""

        def moves() -> bool:
            end = time.monotonic() + 3.0
            while time.monotonic() < end:
                self.hold(key, 0.05)
                if self.case.watcher.speed() > MOVING:
                    return True
            self.terminal.listen(1.5)
            return False

        wait_for(moves, "motion")

    def stands(self) -> bool:
        """Wait until the body stands; whether it still does after a while."""
        rest = self.case.rig.rest
        wait_for(lambda: self.case.watcher.speed() < rest, "a standing body")
        began = time.monotonic()
        self.terminal.listen(STILL_S)
        return self.case.watcher.last_moved(rest) < began


@contextlib.contextmanager
def driving(rig: object, folder: Path) -> Iterator[Drive]:
    """A drive before a robot that stands."""
    with case_of(rig) as case:  # type: ignore[arg-type]
        made = Drive(case, folder)
        try:
            yield made
        finally:
            made.terminal.close()


@pytest.fixture(scope="module")
def case() -> Iterator[Case]:
    """One Segway for all that leave its daemon alive."""
    with case_of(SEGWAY) as made:
        yield made


@pytest.fixture
def drive(case: Case, tmp_path: Path) -> Iterator[Drive]:
    made = Drive(case, tmp_path)
    yield made
    made.terminal.close()
    wait_for(lambda: case.watcher.speed() < SEGWAY.rest, "a standing body")


@pytest.mark.parametrize("rig", [P3DX, SPYKEE], ids=lambda rig: rig.platform)
def test_any_base_moves_as_long_as_the_key_is_held(rig: object, tmp_path: Path) -> None:
    with driving(rig, tmp_path) as drive:
        drive.hold_until_it_moves()
        drive.terminal.wait(r"ordered \+0\.[23]0 m/s")
        assert drive.stands()
        drive.terminal.type("q")
        assert drive.terminal.ended() == 0


def test_speeds_are_shown_and_changed(drive: Drive) -> None:
    drive.hold("w", 1.5)
    drive.terminal.wait(r"ordered \+0\.20 m/s \+0\.00 rad/s  measured \+0\.(1[5-9]|2\d) ")
    drive.terminal.type("++")
    drive.terminal.wait(r"full 0\.24 0\.6[01]")
    drive.terminal.type(" ")
    assert drive.stands()
    drive.hold("\x1b[D", 0.3)
    drive.terminal.wait(r"ordered \+0\.00 m/s \+0\.6[01] rad/s")
    assert drive.stands()


@pytest.mark.parametrize("key", ["q", "\x03", "\x1a", "\x04", " "], ids=["q", "Ctrl-C", "Ctrl-Z", "Ctrl-D", "space"])
def test_keys_that_stop(drive: Drive, key: str) -> None:
    drive.hold_until_it_moves()
    drive.terminal.type(key)
    assert drive.stands()
    if key not in "\x1a ":
        assert drive.terminal.ended() == 0
        assert drive.terminal.settings() == drive.terminal.at_first


def test_it_says_that_the_base_stands_when_it_does(drive: Drive) -> None:
    drive.hold_until_it_moves()
    drive.terminal.type("+" * 24)
    drive.hold("w", 3.0)
    assert drive.case.watcher.speed() > 1.0
    drive.terminal.type("q")
    drive.terminal.wait("stands: left")
    assert drive.case.watcher.speed() < 0.15


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM, signal.SIGKILL, signal.SIGSTOP, signal.SIGTSTP])
def test_signals_that_stop(drive: Drive, number: signal.Signals) -> None:
    drive.hold_until_it_moves()
    drive.terminal.process.send_signal(number)
    drive.hold("w", 0.3)
    if number == signal.SIGTSTP:
        # A process without a shell cannot be suspended: it drives on when a key is pressed again.
        drive.terminal.listen(1.0)
    assert drive.stands()


def test_a_terminal_that_is_gone(case: Case, tmp_path: Path) -> None:
    drive = Drive(case, tmp_path)
    drive.hold_until_it_moves()
    terminal = drive.terminal
    os.close(terminal._side)
    os.close(terminal._end)
    wait_for(lambda: terminal.process.poll() is not None, "the end of the program")
    wait_for(lambda: case.watcher.speed() < SEGWAY.rest, "a standing body")


def test_a_stop_by_somebody_else_holds_until_the_key_is_released(drive: Drive) -> None:
    drive.hold_until_it_moves()
    drive.case.client.say("robot.stop;")
    drive.hold("w", 1.5)
    assert drive.case.watcher.speed() < SEGWAY.rest
    assert "somebody else stopped" in drive.terminal.heard
    drive.terminal.listen(1.0)
    drive.hold_until_it_moves()
    assert drive.stands()


def test_orders_that_a_network_has_held_up_move_nothing(case: Case, tmp_path: Path) -> None:
    network = SlowNetwork(case.daemon.port)
    drive = Drive(case, tmp_path, network.port)
    try:
        drive.hold_until_it_moves()
        network.stalled.set()
        drive.hold("w", 0.3)
        assert drive.terminal.ended() == 69
        wait_for(lambda: case.watcher.speed() < SEGWAY.rest, "a standing body")
        began = time.monotonic()
        network.stalled.clear()
        time.sleep(2.0)
        assert case.watcher.last_moved(SEGWAY.rest) < began
    finally:
        network.stalled.clear()
        drive.terminal.close()


def test_an_emergency_stop_is_told(drive: Drive) -> None:
    drive.case.daemon.order(do="estop", who="test")
    drive.hold("w", 0.5)
    drive.terminal.wait(r"emergency stop \(test\)")
    assert drive.stands()
    drive.case.daemon.order(do="release", who="test")
    drive.terminal.listen(1.0)
    drive.hold_until_it_moves()
    assert drive.stands()


def test_a_server_that_is_gone(tmp_path: Path) -> None:
    with driving(SEGWAY, tmp_path) as drive:
        drive.hold_until_it_moves()
        drive.case.daemon.process.kill()
        assert drive.terminal.ended() == 69
        assert "urbihw drive: " in drive.terminal.heard
        assert drive.stands()


def test_a_server_without_a_base(tmp_path: Path) -> None:
    from programs_lab import Server

    with contextlib.closing(Server(tmp_path)) as server:
        terminal = Terminal("main", "drive", f":{server.port}", cwd=tmp_path)
        assert terminal.ended() == 69
        assert "has no robot that drives" in terminal.heard
        terminal.close()
