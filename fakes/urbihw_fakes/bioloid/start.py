"""How `python -m urbihw_fakes bioloid` is started; see `urbihw_fakes.__main__`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

from urbihw_fakes.bioloid.console import commands, in_world
from urbihw_fakes.bioloid.kit import Bioloid
from urbihw_fakes.bodies.humanoid import Humanoid
from urbihw_fakes.console import Command
from urbihw_fakes.dynamixel.catalogue import make_servos
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.endpoint import PtyEndpoint, TcpEndpoint
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.serving import Endpoint

HELP = "18 AX-12 (1..18) and an AX-S1 (100), or X-series servos"
DEFAULT_BAUD = 1_000_000
FIRST_X = 21


def options(parser: argparse.ArgumentParser) -> None:
    """The options of the simulated Bioloid on the command line."""
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--pty", nargs="?", const="", metavar="PATH", help="a pseudo terminal, linked at PATH")
    where.add_argument("--tcp", type=int, metavar="PORT", help="a TCP port of this machine; 0 takes a free one")
    parser.add_argument("--pace", action="store_true", help="bytes take the time they take on the wire")
    parser.add_argument("--spin", action="store_true", help="with --pace: never sleep in traffic, for benches")
    parser.add_argument("--baud", type=int, help=f"speed of units and wire ({DEFAULT_BAUD})")
    parser.add_argument("--follow-baud", action="store_true", help="on a pty: hear only the speed the peer has set")
    parser.add_argument("--x-series", type=int, nargs="?", const=18, metavar="COUNT", help="X-series servos instead")
    parser.add_argument("--add-x", type=int, default=0, metavar="COUNT", help="X-series servos besides, from id 21 on")
    parser.add_argument("--servos", metavar="MODEL:ID,...", help='other units instead, for instance "MX-28:3,XL-320:4"')
    parser.add_argument("--cm5", action="store_true", help="behind a CM-5 in manage mode; the wire has 57600 bps")
    parser.add_argument("--world", metavar="WORLD", help="as a humanoid in MuJoCo: room, flat, or a file .xml")
    parser.add_argument("--model", default="XL430-W250", help="of the X-series servos (%(default)s)")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """The kit on its transport, and its words for the console."""
    kit = _kit(options)
    endpoint = _endpoint(options, kit)
    words = commands(kit, endpoint.clock)
    return endpoint, in_world(kit, words) if isinstance(kit, Humanoid) else words


def _kit(options: argparse.Namespace) -> Bioloid:
    baud = DEFAULT_BAUD if options.cm5 else options.baud or DEFAULT_BAUD
    if options.world is not None:
        if options.servos is not None or options.x_series is not None or options.add_x:
            raise UnknownRequest("--world: the humanoid is the kit of 18 AX-12 and an AX-S1; leave the other units out")
        return Humanoid(options.world, baud=baud, cm5=options.cm5)
    if options.servos is not None:
        return Bioloid(units=make_servos(options.servos), baud=baud)
    if options.x_series is not None:
        return Bioloid.x_series(options.x_series, model=options.model, baud=baud)
    kit = Bioloid(baud=baud, cm5=options.cm5)
    for number in range(options.add_x):
        unit = XSeries(options.model, FIRST_X + number)
        unit.set_baud(baud)
        kit.add(unit)
    return kit


def _endpoint(options: argparse.Namespace, kit: Bioloid) -> Endpoint:
    pace = (options.baud or DEFAULT_BAUD) if options.pace else None
    if options.tcp is not None:
        return TcpEndpoint(kit, options.tcp, pace=pace, spin=options.spin)
    return PtyEndpoint(kit, options.pty or None, pace=pace, spin=options.spin, follow_baud=options.follow_baud)
