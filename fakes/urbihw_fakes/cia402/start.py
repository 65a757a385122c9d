"""How a simulated drive is reached: the arguments of `python -m urbihw_fakes cia402`.

    --pty [PATH]                       behind a CAN adapter with the slcan text on a pseudo terminal
    --can udp_multicast/239.74.163.2   on an interface of python-can, here multicast, which stays on this machine
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING

from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.slcan import Slcan
from urbihw_fakes.can.slcan_pty import SlcanPty
from urbihw_fakes.console import Command
from urbihw_fakes.serving import Endpoint

if TYPE_CHECKING:
    from urbihw_fakes.cia402.node import Drive

HELP = "a servo drive after CiA 402 on CANopen"
MULTICAST_PORT = 43113


def options(parser: argparse.ArgumentParser) -> None:
    """The arguments of this robot."""
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--pty", nargs="?", const="", metavar="PATH", help="a pseudo terminal, linked at PATH")
    where.add_argument("--can", metavar="INTERFACE/CHANNEL", help="such as udp_multicast/239.74.163.2")
    parser.add_argument("--port", type=int, default=MULTICAST_PORT, help="of multicast (%(default)s)")
    parser.add_argument("--node", type=int, default=5, choices=range(1, 128), metavar="N", help="(%(default)s)")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """The drive where it was asked for, and what can be typed at it.

    Raises:
        FakeError: the place cannot be had.
    """
    # Only who runs this needs canopen and python-can.
    from urbihw_fakes.cia402.node import Drive

    drive = Drive(options.node)
    words = words_of(drive)
    if options.can is None:
        return SlcanPty(CanDevice(drive, Slcan()), options.pty or None), words
    from urbihw_fakes.can.endpoint import BusEndpoint
    from urbihw_fakes.can.records import Records

    interface, _, channel = options.can.partition("/")
    more = {"port": options.port, "hop_limit": 0} if interface == "udp_multicast" else {}
    return BusEndpoint(CanDevice(drive, Records()), interface, channel, **more), words


def words_of(drive: Drive) -> Mapping[str, Command]:
    """The console commands of a drive."""

    def fault(words: list[str]) -> str:
        drive.fault(int(words[0], 16)) if words else drive.fault()
        return "ok"

    def show(words: list[str]) -> str:
        machine = drive.machine
        return f"{machine.state}, mode {machine.mode}, {machine.position:.0f} at {machine.speed:.0f}/s"

    return {
        "fault": Command("[CODE]", "let something go wrong (3210, hexadecimal)", fault),
        "show": Command("", "state, mode, position and speed in increments", show),
    }
