"""Run a simulated robot: `python -m urbihw_fakes bioloid --pty [PATH]` or `--tcp PORT`.

The first line printed is the url to give the gateway. Then it serves until SIGTERM, SIGINT or, with --until-eof, the
end of its input, and carries out what is typed (say `help`). With --json it talks to a program: the second line tells
its words, and each line of input is answered by one line of JSON.

A robot is a package here with a module `start`: a line of help, its options, and how it is started from them.
Other packages name such modules by entry points of the group `urbihw.fakes`.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from urbihw_fakes.console import Command, Console
from urbihw_fakes.errors import FakeError, UnknownRequest
from urbihw_fakes.serving import Endpoint

EXIT_CONFIG = 78
ENTRY_POINTS = "urbihw.fakes"


class Start(Protocol):
    """How a robot is started, as a module."""

    HELP: str

    def options(self, parser: argparse.ArgumentParser) -> None:
        """Add the robot's own options."""

    def start(self, options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
        """The robot on its transport, and its own words for the console."""


def robots() -> dict[str, Start]:
    """The robots of this package, by the names of their folders."""
    names = sorted(path.parent.name for path in Path(__file__).parent.glob("*/start.py"))
    return {name: cast(Start, import_module(f"urbihw_fakes.{name}.start")) for name in names}


def outside_robots() -> dict[str, Start]:
    """The robots of other packages; one that fails is left out, and named on standard error."""
    # Imported here because it costs 15 ms, and most robots are of this package.
    from importlib.metadata import entry_points

    found = {}
    for entry in entry_points(group=ENTRY_POINTS):
        try:
            found[entry.name] = cast(Start, import_module(entry.value))
        except Exception as error:
            wheel = entry.dist.name if entry.dist is not None else entry.value
            why = " ".join(str(error).split())
            print(f"fakes: {entry.name} of {wheel}: {type(error).__name__}: {why}", file=sys.stderr)
    return found


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    known = robots()
    if not {*arguments} & known.keys():
        known = outside_robots() | known
    options = _parser(known).parse_args(arguments)
    try:
        if getattr(options, "refused_world", None):
            raise UnknownRequest(f"--world: {options.robot} has no body for a simulated world")
        endpoint, words = known[options.robot].start(options)
    except (FakeError, OSError) as error:
        print(f"fakes: {error}", file=sys.stderr)
        return EXIT_CONFIG
    with endpoint:
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: endpoint.stop())
        console = Console(endpoint, words)
        _listen(endpoint, console, options)
        try:
            print(endpoint.url, flush=True)
            if options.json:
                print(json.dumps(console.words()), flush=True)
        except BrokenPipeError:  # who started it has ended meanwhile
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        endpoint.serve()
    return 0


def _parser(known: Mapping[str, Start]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("python -m urbihw_fakes", description="A simulated robot, on a real transport.")
    parsers = parser.add_subparsers(dest="robot", required=True, metavar="ROBOT")
    for name, robot in known.items():
        own = parsers.add_parser(name, help=robot.HELP)
        robot.options(own)
        # A program may ask any robot for a world; one without a body says so in one line.
        with contextlib.suppress(argparse.ArgumentError):
            own.add_argument("--world", dest="refused_world", help=argparse.SUPPRESS)
        own.add_argument("--until-eof", action="store_true", help="end when standard input ends")
        own.add_argument("--json", action="store_true", help="answer each line of input with one line of JSON")
    return parser


def _listen(endpoint: Endpoint, console: Console, options: argparse.Namespace) -> None:
    """Carry out the lines of standard input between requests."""
    source = sys.stdin.fileno()
    rest = b""

    def ready() -> None:
        nonlocal rest
        data = os.read(source, 4096)
        if not data:
            endpoint.unwatch(source)
            if options.until_eof:
                endpoint.stop()
        *lines, rest = (rest + data).split(b"\n")
        for line in lines:
            answer = console.line(line.decode(errors="replace"))
            if options.json:
                print(json.dumps(answer), flush=True)
            elif answer:
                print(answer, flush=True)

    endpoint.watch(source, ready)


if __name__ == "__main__":
    sys.exit(main())
