"""The arguments of `python -m urbihw_fakes segway`: the transport of a simulated RMP.

    --pty [PATH]                       a CAN adapter with slcan text on a pseudo terminal
    --pty [PATH] --usb                 the maker's USB link on one
    --tcp PORT [--usb]                 the same two behind a TCP port
    --can udp_multicast/239.74.163.2   an interface of python-can, here multicast on this machine
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping

from urbihw_fakes.bodies.balance import BalancingBody
from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.records import Records
from urbihw_fakes.can.slcan import Slcan
from urbihw_fakes.can.slcan_pty import SlcanPty
from urbihw_fakes.console import Command
from urbihw_fakes.endpoint import PtyEndpoint, TcpEndpoint
from urbihw_fakes.segway.body import Body
from urbihw_fakes.segway.console import commands
from urbihw_fakes.segway.frames import BALANCE, MODELS, TRACTOR
from urbihw_fakes.segway.rmp import SegwayRmp
from urbihw_fakes.segway.usb import UsbLink
from urbihw_fakes.serving import Endpoint

HELP = "a Segway RMP that balances, behind a CAN adapter or its USB link"
USB_BAUD = 460_800
MULTICAST_PORT = 43113


class SlcanTcp(TcpEndpoint):
    """An slcan adapter behind a TCP port."""

    @property
    def url(self) -> str:
        """`can://slcan/socket://` and the port."""
        return f"can://slcan/socket://127.0.0.1:{self.port}?sleep_after_open=0"


class UsbPty(PtyEndpoint):
    """The USB link on a pseudo terminal."""

    @property
    def url(self) -> str:
        """`serial://`, the path and the speed."""
        return f"serial://{self.path}?baud={USB_BAUD}"


def options(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this robot."""
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--pty", nargs="?", const="", metavar="PATH", help="a pseudo terminal, linked at PATH")
    where.add_argument("--tcp", type=int, metavar="PORT", help="a TCP port of this machine; 0 takes a free one")
    where.add_argument("--can", metavar="INTERFACE/CHANNEL", help="such as udp_multicast/239.74.163.2")
    parser.add_argument("--usb", action="store_true", help="the maker's USB link, not a CAN adapter")
    parser.add_argument("--port", type=int, default=MULTICAST_PORT, help="of multicast (%(default)s)")
    parser.add_argument("--model", default="200", choices=sorted(MODELS), help="(%(default)s)")
    parser.add_argument("--tractor", action="store_true", help="standing on casters, not balancing")
    parser.add_argument("--world", metavar="WORLD", help="with a body in MuJoCo: room, flat, or a file .xml")
    parser.add_argument("--old", action="store_true", help="the oldest firmware, with five frames a cycle")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """Return the robot on its transport, and its console commands.

    Raises:
        FakeError: the transport is not available.
    """
    body = Body() if options.world is None else BalancingBody(options.world, options.tractor)
    mode = TRACTOR if options.tractor else BALANCE
    base = SegwayRmp(options.model, mode=mode, old_firmware=options.old, body=body)
    return _endpoint(options, base), commands(base)


def _endpoint(options: argparse.Namespace, base: SegwayRmp) -> Endpoint:
    if options.can is not None:
        # Only this needs python-can.
        from urbihw_fakes.can.endpoint import BusEndpoint

        interface, _, channel = options.can.partition("/")
        more = {"port": options.port, "hop_limit": 0} if interface == "udp_multicast" else {}
        return BusEndpoint(CanDevice(base, Records()), interface, channel, **more)
    if options.usb:
        device = CanDevice(base, UsbLink())
        return UsbPty(device, options.pty or None) if options.tcp is None else TcpEndpoint(device, options.tcp)
    device = CanDevice(base, Slcan())
    return SlcanPty(device, options.pty or None) if options.tcp is None else SlcanTcp(device, options.tcp)
