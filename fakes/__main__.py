"""Run a robot in software: `python -m fakes bioloid --pty [PATH]` or `--tcp PORT`.

The first line printed is the url to give the gateway. Then it serves until SIGTERM, SIGINT or, with --until-eof, the
end of its input, and carries out what is typed (say `help`).
"""

from __future__ import annotations

import argparse
import os
import signal
import sys

from fakes.bioloid import Bioloid
from fakes.bioloid_console import commands
from fakes.console import Console
from fakes.endpoint import PtyEndpoint, TcpEndpoint
from fakes.errors import FakeError
from fakes.serving import Endpoint

DEFAULT_BAUD = 1_000_000
EXIT_CONFIG = 78


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    options = _parser().parse_args(arguments)
    try:
        kit = _kit(options)
        endpoint = _endpoint(options, kit)
    except (FakeError, OSError) as error:
        print(f"fakes: {error}", file=sys.stderr)
        return EXIT_CONFIG
    with endpoint:
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: endpoint.stop())
        _listen(endpoint, Console(endpoint, commands(kit, endpoint.clock)), options.until_eof)
        print(endpoint.url, flush=True)
        endpoint.serve()
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m fakes", description="A robot in software, on a real transport.")
    robots = parser.add_subparsers(dest="robot", required=True, metavar="ROBOT")
    bioloid = robots.add_parser("bioloid", help="18 AX-12 (1..18) and an AX-S1 (100), or X-series servos")
    where = bioloid.add_mutually_exclusive_group(required=True)
    where.add_argument("--pty", nargs="?", const="", metavar="PATH", help="a pseudo terminal, linked at PATH")
    where.add_argument("--tcp", type=int, metavar="PORT", help="a TCP port of this machine; 0 takes a free one")
    bioloid.add_argument("--pace", action="store_true", help="bytes take the time they take on the wire")
    bioloid.add_argument("--spin", action="store_true", help="with --pace: never sleep in traffic, for benches")
    bioloid.add_argument("--baud", type=int, help=f"speed of units and wire ({DEFAULT_BAUD})")
    bioloid.add_argument("--follow-baud", action="store_true", help="on a pty: hear only the speed the peer has set")
    bioloid.add_argument("--x-series", type=int, nargs="?", const=18, metavar="COUNT", help="X-series servos instead")
    bioloid.add_argument("--model", default="XL430-W250", help="of the X-series servos (%(default)s)")
    bioloid.add_argument("--until-eof", action="store_true", help="end when standard input ends")
    return parser


def _kit(options: argparse.Namespace) -> Bioloid:
    baud = options.baud or DEFAULT_BAUD
    if options.x_series is not None:
        return Bioloid.x_series(options.x_series, model=options.model, baud=baud)
    return Bioloid(baud=baud)


def _endpoint(options: argparse.Namespace, kit: Bioloid) -> Endpoint:
    pace = (options.baud or DEFAULT_BAUD) if options.pace else None
    if options.tcp is not None:
        return TcpEndpoint(kit, options.tcp, pace=pace, spin=options.spin)
    return PtyEndpoint(kit, options.pty or None, pace=pace, spin=options.spin, follow_baud=options.follow_baud)


def _listen(endpoint: Endpoint, console: Console, until_eof: bool) -> None:
    """Carry out the lines of standard input between requests."""
    source = sys.stdin.fileno()
    rest = b""

    def ready() -> None:
        nonlocal rest
        data = os.read(source, 4096)
        if not data:
            endpoint.unwatch(source)
            if until_eof:
                endpoint.stop()
        *lines, rest = (rest + data).split(b"\n")
        for line in lines:
            answer = console.line(line.decode(errors="replace"))
            if answer:
                print(answer, flush=True)

    endpoint.watch(source, ready)


if __name__ == "__main__":
    sys.exit(main())
