"""How `python -m urbihw_fakes chain` is started; see `urbihw_fakes.__main__`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

from urbihw_fakes.bioloid import console
from urbihw_fakes.chain.parts import chain_of
from urbihw_fakes.console import Command
from urbihw_fakes.endpoint import PtyEndpoint, TcpEndpoint
from urbihw_fakes.feetech import start as feetech
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.serving import Endpoint

HELP = "a chain of servos of any models: Dynamixel of both protocols, or Feetech"
SERVOS = "AX-12:1,AX-12:2,XL330-M288:3,XL330-M288:4,MX-28:5"


def options(parser: argparse.ArgumentParser) -> None:
    """The options of the simulated chain on the command line."""
    feetech.wire_options(parser)
    parser.add_argument("--servos", default=SERVOS, metavar="MODEL:ID,...", help="models and ids (%(default)s)")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """The chain on its transport, and its words for the console."""
    bus = chain_of(options.servos)
    if isinstance(bus, FeetechBus):
        return feetech.serve(options, bus, {})
    bus.set_baud(options.baud)
    pace = options.baud if options.pace else None
    endpoint: Endpoint
    if options.tcp is not None:
        endpoint = TcpEndpoint(bus, options.tcp, pace=pace, spin=options.spin)
    else:
        endpoint = PtyEndpoint(bus, options.pty or None, pace=pace, spin=options.spin, follow_baud=options.follow_baud)
    return endpoint, console.commands(bus, endpoint.clock)
