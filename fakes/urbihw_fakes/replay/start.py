"""How `python -m urbihw_fakes replay` is started; see `urbihw_fakes.__main__`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.slcan import Slcan
from urbihw_fakes.can.slcan_pty import SlcanPty
from urbihw_fakes.console import Command
from urbihw_fakes.endpoint import PtyEndpoint, TcpEndpoint
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.replay.capture import read_capture
from urbihw_fakes.replay.device import Replay
from urbihw_fakes.replay.node import ReplayNode
from urbihw_fakes.serving import Endpoint

HELP = "a recorded robot, from a capture with times"


def options(parser: argparse.ArgumentParser) -> None:
    """The options of a recorded robot on the command line."""
    parser.add_argument("file", type=Path, metavar="FILE", help="the capture")
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--pty", nargs="?", const="", metavar="PATH", help="a pseudo terminal, linked at PATH")
    where.add_argument("--tcp", type=int, metavar="PORT", help="a TCP port of this machine; 0 takes a free one")
    parser.add_argument("--strict", action="store_true", help="answer only as long as requests come as recorded")
    parser.add_argument("--speed", type=float, default=1.0, help="answers come so many times as fast; 0: at once (1)")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """The recorded robot on its transport, and its words for the console."""
    if not 0 <= options.speed <= 1e6:
        raise UnknownRequest(f"--speed {options.speed}: 0 to a million")
    with options.file.open(encoding="ascii", errors="replace") as file:
        capture = read_capture(file)
    device = Replay(capture, strict=options.strict, speed=options.speed)
    endpoint: Endpoint
    if capture.is_can:
        if options.tcp is not None:
            raise UnknownRequest("--tcp: this is the recording of a CAN bus; a CAN adapter is on a --pty")
        endpoint = SlcanPty(CanDevice(ReplayNode(device), Slcan()), options.pty or None)
    elif options.tcp is not None:
        endpoint = TcpEndpoint(device, options.tcp)
    else:
        endpoint = PtyEndpoint(device, options.pty or None)
    device.plug = lambda is_plugged: endpoint.plug() if is_plugged else endpoint.unplug()
    words = {"compare": Command("", "what the host asked otherwise than recorded", lambda _: device.compared())}
    return endpoint, words
