"""The real daemon with a simulated RMP on a real port, as a user meets it.  Few, and on the real clock."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import pytest
from test_serve import TIMEOUT_S, Daemon, until

from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.endpoint import BusEndpoint
from urbihw_fakes.can.records import Records
from urbihw_fakes.can.slcan import Slcan
from urbihw_fakes.can.slcan_pty import SlcanPty
from urbihw_fakes.segway.rmp import SegwayRmp
from urbihw_fakes.segway.start import UsbPty
from urbihw_fakes.segway.usb import UsbLink
from urbihw_fakes.serving import Endpoint

pytestmark = pytest.mark.e2e

GROUP, PORT = f"239.74.{os.getpid() >> 8 & 255}.{os.getpid() & 255}", 43211
"""Another group for each process of tests: they may run side by side."""


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    with contextlib.ExitStack() as stack:
        yield lambda *arguments: stack.enter_context(
            contextlib.closing(Daemon(tmp_path, "--platform", "segway", "--quiet", *arguments))
        )


def _multicast(base: SegwayRmp) -> Endpoint:
    try:
        can.Bus(GROUP, "udp_multicast", port=PORT, hop_limit=0).shutdown()
    except (can.CanError, OSError) as error:
        pytest.skip(f"no multicast here: {error}")
    return BusEndpoint(CanDevice(base, Records()), "udp_multicast", GROUP, port=PORT, hop_limit=0)


ENDPOINTS: dict[str, Callable[[SegwayRmp], Endpoint]] = {
    "slcan": lambda base: SlcanPty(CanDevice(base, Slcan())),
    "usb": lambda base: UsbPty(CanDevice(base, UsbLink())),
    "udp_multicast": _multicast,
}


@pytest.fixture(params=ENDPOINTS)
def end(request: pytest.FixtureRequest) -> Iterator[Endpoint]:
    with ENDPOINTS[request.param](SegwayRmp()) as made:
        made.start()
        yield made


def base_of(end: Endpoint) -> SegwayRmp:
    device: Any = end.device
    base = device.node
    assert isinstance(base, SegwayRmp)
    return base


def speed(end: Endpoint) -> float:
    return end.call(lambda: base_of(end).body.speed)


@pytest.mark.long
def test_it_drives_over_every_kind_of_link_and_stops_with_its_connection(
    serve: Callable[..., Daemon], end: Endpoint
) -> None:
    daemon = serve("--url", end.url)
    client = daemon.client()
    assert client.ask("var rmp = RMP.new(0.05);").startswith("RMP_")
    assert client.ask("rmp.forwardSpeed = 0.4;") == "0.4"
    until(lambda: speed(end) > 0.39)
    assert float(client.ask("rmp.forward;")) > 0.01
    client.close()
    until(lambda: speed(end) == 0.0)
    until(lambda: "is closed, which moved it" in daemon.log())
    place = end.call(lambda: base_of(end).body.forward)
    time.sleep(0.5)
    # It stays where it is, under the commands that go on.
    assert speed(end) == 0.0
    assert end.call(lambda: base_of(end).body.forward) == place


def test_a_killed_daemon_leaves_a_stopped_base(serve: Callable[..., Daemon]) -> None:
    with ENDPOINTS["slcan"](SegwayRmp()) as end:
        end.start()
        daemon = serve("--url", end.url)
        daemon.client().say("rmp.forwardSpeed = 1;")
        until(lambda: speed(end) > 0.9)
        daemon.process.kill()
        until(lambda: end.call(lambda: base_of(end).reading().velocity) == 0)
        until(lambda: speed(end) == 0.0)


def test_a_stop_of_the_daemon_is_clean(serve: Callable[..., Daemon]) -> None:
    with ENDPOINTS["usb"](SegwayRmp()) as end:
        end.start()
        daemon = serve("--url", end.url)
        daemon.client().say("rmp.forwardSpeed = 1;")
        until(lambda: speed(end) > 0.9)
        daemon.process.send_signal(signal.SIGTERM)
        assert daemon.process.wait(TIMEOUT_S) == 0
        # The base stops by itself too, 0.4 s after the last command: what it was told last is the judge.
        until(lambda: end.call(lambda: base_of(end).last_command) == (0, 0), log=daemon.log)
        until(lambda: speed(end) == 0.0)


class FakeProcess:
    """`python -m urbihw_fakes segway` at a path that stays."""

    def __init__(self, path: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "urbihw_fakes", "segway", "--pty", str(path), "--until-eof"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().strip()

    def close(self) -> None:
        self.process.kill()
        self.process.wait(TIMEOUT_S)
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            pipe.close()


def test_the_base_dies_and_comes_back_during_a_behaviour(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    with contextlib.closing(FakeProcess(tmp_path / "rmp")) as first:
        daemon = serve("--url", first.url)
        client = daemon.client()
        client.say("rmp.forwardSpeed = 0 sin:1s ampli:0.3,")
        until(lambda: abs(float(client.ask("rmp.forwardSpeed;"))) > 0.1)
        before = len(daemon.log().splitlines())
    until(lambda: client.ask("segway.link;") == "false")
    with contextlib.closing(FakeProcess(tmp_path / "rmp")) as second:
        assert second.url == first.url
        daemon.wait_for_link(before)
        until(lambda: abs(float(client.ask("rmp.forwardSpeed;"))) > 0.1)
        assert len(daemon.link_news(before)) == 2


def test_the_fake_of_the_platform(serve: Callable[..., Daemon]) -> None:
    daemon = serve("--fake")
    client = daemon.client()
    assert client.ask("rmp.mode;") == '"balance"'
    began = time.monotonic()
    # A worker that is held up stops the base, and the client hears of it.
    until(lambda: client.ask("robot.go(0.5) | rmp.forward > 0.4;") == "true")
    assert time.monotonic() - began > 1
    assert os.path.exists(client.ask("segway.url;").strip('"').removeprefix("can://slcan").partition("?")[0])


def test_a_base_in_use_says_who_has_it(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    with ENDPOINTS["slcan"](SegwayRmp()) as end:
        end.start()
        serve("--url", end.url)
        (tmp_path / "second").mkdir()
        second = Daemon(tmp_path / "second", "--platform", "segway", "--url", end.url, "--quiet")
        with contextlib.closing(second):
            assert "is in use by another program" in second.log().splitlines()[0]
            assert second.client().ask("segway.link;") == "false"
