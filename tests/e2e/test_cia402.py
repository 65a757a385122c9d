"""The real daemon with a simulated CiA 402 drive, and what becomes of the drive when the daemon's worker dies."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_serve import Daemon, until

from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.slcan import Slcan
from urbihw_fakes.can.slcan_pty import SlcanPty
from urbihw_fakes.cia402.node import Drive

pytestmark = pytest.mark.e2e


@pytest.fixture
def drive() -> Drive:
    return Drive(5)


@pytest.fixture
def end(drive: Drive) -> Iterator[SlcanPty]:
    with SlcanPty(CanDevice(drive, Slcan())) as made:
        made.start()
        yield made


@pytest.fixture
def daemon(tmp_path: Path, end: SlcanPty) -> Iterator[Daemon]:
    made = Daemon(tmp_path, "--platform", "cia402", "--quiet", "--url", end.url)
    yield made
    made.close()


def worker_of(daemon: Daemon) -> int:
    """The process that owns the wire."""
    # A worker belongs to the thread that started it, and a new one is started by the thread that missed the old one.
    threads = Path(f"/proc/{daemon.process.pid}/task").glob("*/children")
    children = [child for thread in threads for child in thread.read_text("ascii").split()]
    lines = {int(child): Path(f"/proc/{child}/cmdline").read_bytes() for child in children}
    # The spare worker is younger.
    return min(child for child, line in lines.items() if b"urbihw.buses." in line)


def test_a_drive_turns_and_brakes_by_itself_when_the_worker_is_killed(daemon: Daemon, drive: Drive) -> None:
    client = daemon.client()
    assert client.ask("drive5.driveState;") == '"switch on disabled"'
    client.say("drive5.load = 1|;")
    until(lambda: drive.machine.state == "operation enabled")
    until(lambda: client.ask("drive5.load;") == "1")
    client.say("drive5.speed = 6|;")
    until(lambda: drive.machine.speed > 3900)
    killed = worker_of(daemon)
    os.kill(killed, signal.SIGKILL)
    until(lambda: drive.machine.speed == 0.0)
    assert drive.machine.state != "operation enabled"
    # Another worker is there, and the drive stays off until a client wants it on.
    until(lambda: "was ended by SIGKILL; another one is started" in daemon.log())
    until(lambda: client.ask("cia402.link;") == "true")
    assert worker_of(daemon) != killed
    place = drive.machine.position
    time.sleep(0.5)
    assert (drive.machine.position, drive.machine.speed) == (place, 0.0)
    assert client.ask("drive5.load;") == "0"
    client.say("drive5.load = 1|;")
    until(lambda: drive.machine.state == "operation enabled")
    until(lambda: client.ask("drive5.load;") == "1")
    client.say("drive5.speed = 6|;")
    until(lambda: drive.machine.speed > 3900)


def test_a_drive_without_power_is_two_lines_in_the_log(daemon: Daemon, drive: Drive, end: SlcanPty) -> None:
    before = len(daemon.log().splitlines())
    end.call(lambda: drive.power_off(end.clock()))
    until(lambda: "drive 5 is lost" in daemon.log())
    end.call(lambda: drive.power_on(end.clock()))
    until(lambda: "drive 5 is back" in daemon.log())
    news = [line.partition("urbihw: ")[2] for line in daemon.log().splitlines()[before:]]
    # A busy machine may hold up the worker as well, which is another line.
    assert [line for line in news if line.startswith("drive ")] == [
        "drive 5 is lost: it says nothing",
        "drive 5 is back, and off",
    ]
