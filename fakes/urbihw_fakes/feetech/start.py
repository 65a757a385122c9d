"""How `python -m urbihw_fakes feetech` is started; see `urbihw_fakes.__main__`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

from urbihw_fakes.console import Command
from urbihw_fakes.endpoint import PtyEndpoint, TcpEndpoint
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.console import commands
from urbihw_fakes.feetech.servo import FeetechServo
from urbihw_fakes.serving import Endpoint

HELP = "Feetech servos: any of the STS and SCS series on one wire"
DEFAULT_BAUD = 1_000_000
_SERVOS = "STS3215:1,STS3215:2,SCS0009:7"


def options(parser: argparse.ArgumentParser) -> None:
    """The options of the simulated Feetech bus on the command line."""
    wire_options(parser)
    parser.add_argument("--servos", default=_SERVOS, metavar="MODEL:ID,...", help="the servos (%(default)s)")


def wire_options(parser: argparse.ArgumentParser) -> None:
    """The options of the wire, which all chains of Feetech servos share."""
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--pty", nargs="?", const="", metavar="PATH", help="a pseudo terminal, linked at PATH")
    where.add_argument("--tcp", type=int, metavar="PORT", help="a TCP port of this machine; 0 takes a free one")
    parser.add_argument("--pace", action="store_true", help="bytes take the time they take on the wire")
    parser.add_argument("--spin", action="store_true", help="with --pace: never sleep in traffic, for benches")
    parser.add_argument("--baud", type=int, default=DEFAULT_BAUD, help="speed of servos and wire (%(default)s)")
    parser.add_argument("--follow-baud", action="store_true", help="on a pty: hear only the speed the peer has set")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """The chain on its transport, and its words for the console."""
    return serve(options, FeetechBus(servos_of(options.servos)), {})


def serve(
    options: argparse.Namespace, bus: FeetechBus, names: Mapping[str, int]
) -> tuple[Endpoint, Mapping[str, Command]]:
    """Put a chain on the wire of the options; `names` are joints by name."""
    for unit in bus:
        unit.set_baud(options.baud)
    pace = options.baud if options.pace else None
    endpoint: Endpoint
    if options.tcp is not None:
        endpoint = TcpEndpoint(bus, options.tcp, pace=pace, spin=options.spin)
    else:
        endpoint = PtyEndpoint(
            bus, options.pty or None, pace=pace, spin=options.spin, follow_baud=options.follow_baud
        )
    return endpoint, commands(bus, endpoint.clock, names)


def servos_of(text: str) -> list[FeetechServo]:
    """Return the servos of `MODEL:ID,...`. Raises UnknownRequest."""
    servos = []
    for part in text.split(","):
        model, _, number = part.strip().partition(":")
        if not number.isdigit() or int(number) > 253:
            raise UnknownRequest(f"servo {part.strip()!r}: write MODEL:ID, for instance STS3215:1")
        servos.append(FeetechServo(model, int(number)))
    return servos
