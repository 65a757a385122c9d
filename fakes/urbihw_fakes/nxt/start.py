"""The arguments of `python -m urbihw_fakes nxt`; see `urbihw_fakes.__main__`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

from urbihw_fakes.bodies.tribot import SimulatedTriBot
from urbihw_fakes.console import Command
from urbihw_fakes.endpoint import PtyEndpoint, TcpEndpoint
from urbihw_fakes.nxt.console import commands
from urbihw_fakes.nxt.stream import PASS, NxtDevice
from urbihw_fakes.nxt.tribot import START, TriBot
from urbihw_fakes.nxt.usb_endpoint import UsbEndpoint
from urbihw_fakes.serving import Endpoint

HELP = "LEGO NXT: a TriBot before a wall"


def options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the simulated NXT."""
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--usb", nargs="?", const="", metavar="FOLDER", help="on a simulated USB bus, kept in FOLDER")
    where.add_argument("--pty", nargs="?", const="", metavar="PATH", help="Bluetooth: a pseudo terminal at PATH")
    where.add_argument("--tcp", type=int, metavar="PORT", help="Bluetooth: a TCP port of this machine; 0: a free one")
    parser.add_argument("--instant", action="store_true", help="answer at once, not a telegram each ms: for benches")
    parser.add_argument("--distance", type=float, default=START, metavar="M", help="from the wall (%(default)s)")
    parser.add_argument("--world", metavar="WORLD", help="with a body in MuJoCo: room, flat, or a file .xml")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """Return the robot on its transport, and its console commands."""
    robot = TriBot(options.distance) if options.world is None else SimulatedTriBot(options.world)
    device = NxtDevice(robot, pass_time=0.0 if options.instant else PASS)
    endpoint = _endpoint(options, device)
    return endpoint, commands(device, endpoint.clock)


def _endpoint(options: argparse.Namespace, device: NxtDevice) -> Endpoint:
    if options.usb is not None:
        return UsbEndpoint(device, options.usb or None)
    if options.tcp is not None:
        return TcpEndpoint(device, options.tcp)
    return PtyEndpoint(device, options.pty or None)
