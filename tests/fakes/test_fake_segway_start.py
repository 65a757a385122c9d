"""How a simulated RMP and a simulated drive are started, reached and spoken to by hand."""

from __future__ import annotations

import argparse
import socket
from types import ModuleType
from typing import Any

import can
import pytest

from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.endpoint import BusEndpoint
from urbihw_fakes.can.records import Records
from urbihw_fakes.cia402 import start as cia402
from urbihw_fakes.console import Console
from urbihw_fakes.errors import FakeError
from urbihw_fakes.segway import start as segway
from urbihw_fakes.segway.rmp import SegwayRmp
from urbihw_fakes.serving import Endpoint

GROUP, PORT = "239.74.163.2", 43223


def started(module: ModuleType, *arguments: str) -> tuple[Endpoint, Console]:
    parser = argparse.ArgumentParser()
    module.options(parser)
    end, words = module.start(parser.parse_args(arguments))
    return end, Console(end, words)


@pytest.mark.parametrize(
    ("arguments", "scheme"),
    [
        (("--pty",), "can://slcan/"),
        (("--pty", "--usb"), "serial:///"),
        (("--tcp", "0"), "can://slcan/socket://127.0.0.1:"),
        (("--tcp", "0", "--usb", "--model", "50", "--old", "--tractor"), "socket://127.0.0.1:"),
    ],
)
def test_the_url_says_how_to_reach_it(arguments: tuple[str, ...], scheme: str) -> None:
    end, _ = started(segway, *arguments)
    with end:
        assert end.url.startswith(scheme)


def test_what_can_be_typed_at_a_base() -> None:
    end, console = started(segway, "--pty")
    with end:
        device: Any = end.device
        base = device.node
        assert console.line("push 3") == "ok"
        assert base.body.pitch == pytest.approx(0.0524, abs=1e-4)
        assert console.line("battery 61.5") == "ok"
        assert base.body.volts == 61.5
        assert console.line("estop on") == "ok"
        assert base.estop
        assert console.line("estop maybe") == "error: estop maybe: say on or off"
        base.body.fallen = True
        assert console.line("lift") == "ok"
        assert not base.body.fallen
        assert console.line("show") == "mode 2, motors off, 0.000 m/s, 0.000 rad/s, 0.000 m, 0.0 deg, 61.5 V"
        assert console.line("push hard") == "error: usage: push DEGREES"
        assert console.line("power off") == "ok"
        assert not base.powered


def test_what_can_be_typed_at_a_drive() -> None:
    end, console = started(cia402, "--pty", "--node", "7")
    with end:
        device: Any = end.device
        assert device.node.number == 7
        assert console.line("show") == "switch on disabled, mode 0, 0 at 0/s"
        assert console.line("fault 8130") == "ok"
        assert device.node.machine.error == 0x8130
        assert console.line("fault x") == "error: usage: fault [CODE]"


def hear(bus: can.BusABC) -> can.Message | None:
    """The next frame; another datagram counts as none."""
    try:
        return bus.recv(5.0)
    except can.CanError:
        return None


def test_a_bus_of_python_can() -> None:
    try:
        far = can.Bus(GROUP, "udp_multicast", port=PORT, hop_limit=0)
    except (can.CanError, OSError) as error:
        pytest.skip(f"no multicast here: {error}")
    base = SegwayRmp()
    with far, BusEndpoint(CanDevice(base, Records()), "udp_multicast", GROUP, port=PORT, hop_limit=0) as end:
        assert end.url == f"can://udp_multicast/{GROUP}?port={PORT}&hop_limit=0"
        end.start()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            stranger.sendto(b"hello", (GROUP, PORT))
        far.send(can.Message(arbitration_id=0x413, is_extended_id=True, data=bytes(8)))
        heard = [message.arbitration_id for _ in range(30) if (message := hear(far)) is not None]
        assert {*range(0x400, 0x408), 0x680, 0x688} <= set(heard)
        assert base.heard == 0
        far.send(can.Message(arbitration_id=0x413, is_extended_id=False, data=bytes(8)))
        for _ in range(100):
            hear(far)
        assert end.call(lambda: base.heard) == 1
        end.unplug()
        assert not end.plugged
        end.plug()
        assert end.plugged


def test_a_bus_without_anything_to_wait_for_is_refused() -> None:
    with pytest.raises(FakeError, match="nothing to wait for"):
        BusEndpoint(CanDevice(SegwayRmp(), Records()), "virtual", "x")
    with pytest.raises(FakeError, match="teapot"):
        BusEndpoint(CanDevice(SegwayRmp(), Records()), "teapot", "x")
