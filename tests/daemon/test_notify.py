"""What the service manager hears, on a real datagram socket."""

from __future__ import annotations

import logging
import os
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from urbihw.daemon.notify import ServiceNotifier

Manager = tuple[str, Callable[[], str]]


@pytest.fixture(params=["path", "abstract"])
def manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Manager]:
    """A service manager: what NOTIFY_SOCKET says, and what it hears next."""
    address = str(tmp_path / "notify") if request.param == "path" else f"@urbihw-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind("\0" + address[1:] if address.startswith("@") else address)
        listening.setblocking(False)
        yield address, lambda: listening.recv(4096).decode()


def test_the_life_of_a_daemon(manager: Manager) -> None:
    address, heard = manager
    with ServiceNotifier.from_environment({"NOTIFY_SOCKET": address}) as notifier:
        notifier.ready("bioloid: 18 servos, 1 sensor")
        assert heard() == "READY=1\nSTATUS=bioloid: 18 servos, 1 sensor"
        notifier.status("bioloid: 18 servos, 1 sensor, 98 Hz")
        assert heard() == "STATUS=bioloid: 18 servos, 1 sensor, 98 Hz"
        notifier.watchdog()
        assert heard() == "WATCHDOG=1"
        notifier.reloading()
        began, moment = heard().split("\n")
        assert began == "RELOADING=1"
        assert 0 <= time.monotonic_ns() // 1000 - int(moment.removeprefix("MONOTONIC_USEC=")) < 60_000_000
        notifier.ready("bioloid: 18 servos, 1 sensor")
        assert heard().startswith("READY=1")
        notifier.stopping()
        assert heard() == "STOPPING=1\nSTATUS=stopping"


def test_a_status_is_one_line(manager: Manager) -> None:
    address, heard = manager
    with ServiceNotifier(address) as notifier:
        notifier.status("one\nREADY=1\r\n two — drei")
        assert heard() == "STATUS=one READY=1 two — drei"
        notifier.status("nxt: 'a\x1b[2J\x9b\udc80'")
        assert heard() == r"STATUS=nxt: 'a\x1b[2J\x9b\udc80'"


def test_closed_is_silent(manager: Manager) -> None:
    address, heard = manager
    notifier = ServiceNotifier(address)
    notifier.close()
    notifier.close()
    notifier.ready("x")
    with pytest.raises(BlockingIOError):
        heard()


def test_without_a_manager_nothing_happens() -> None:
    with ServiceNotifier.from_environment({}) as notifier:
        notifier.ready("x")
        assert notifier.watchdog_period is None


def test_a_manager_that_is_gone_or_does_not_read_harms_nobody(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "notify"
    with ServiceNotifier(str(path)) as notifier, caplog.at_level(logging.DEBUG, "urbihw.notify"):
        notifier.ready("x")
        assert "does not listen" in caplog.text
        caplog.clear()
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as deaf:
            deaf.bind(str(path))
            for _ in range(100_000):
                notifier.watchdog()
                if caplog.records:
                    break
        assert "does not listen" in caplog.text


def test_an_address_of_another_kind_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    with ServiceNotifier("vsock:2:1234") as notifier:
        notifier.ready("x")
        notifier.watchdog()
    (record,) = caplog.records
    assert "vsock:2:1234" in record.getMessage()


@pytest.mark.parametrize(
    ("environment", "period"),
    [
        ({"WATCHDOG_USEC": "3000000"}, 1.5),
        ({"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "77"}, 1.5),
        ({"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "78"}, None),
        ({"WATCHDOG_USEC": "0"}, None),
        ({"WATCHDOG_USEC": "soon"}, None),
        ({}, None),
    ],
)
def test_the_watchdog_is_fed_twice_as_often_as_asked(environment: dict[str, str], period: float | None) -> None:
    assert ServiceNotifier.from_environment(environment, pid=77).watchdog_period == period
