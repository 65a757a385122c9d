"""``urbihw``: the commands of the gateway, one module each.

Exit codes: 0 success, 65 an error in urbiscript source, 69 no daemon answers, 70 an internal error, 78 a configuration
error (bad option, no robot, port in use), for which one line on standard error tells what to do, 130 after Ctrl-C,
where that is no orderly end.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any, Final, NoReturn

from urbihw.cli.options import Version
from urbihw.exitcodes import EX_CONFIG, INTERRUPTED

COMMANDS: Final = {
    "serve": "serve a robot on a TCP port",
    "stop": "stop the robot now",
    "estop": "stop the robot now and let nothing move it until it is released",
    "release": "release the robot after an emergency stop",
    "config": "check settings, show those in force",
    "platforms": "list the robots that urbihw knows",
    "scan": "search the network for robots",
    "console": "an interactive console of a server",
    "drive": "drive a robot by the keyboard or a gamepad",
    "access": "manage access from the network: make, list and remove tokens",
    "dump": "show the stages of compiling urbiscript to Python",
    "doctor": "check whether this machine is ready for a robot",
    "new-platform": "write the skeleton of a new robot into a clone of the sources",
}
"""Subcommand -> help text; each is a module beside this one with ``options(parser)`` and ``run(options)``."""


class Parser(argparse.ArgumentParser):
    """Reports wrong options in one line."""

    def error(self, message: str) -> NoReturn:
        """Print the error and exit with 78."""
        self.exit(EX_CONFIG, f"{self.prog}: {message} (see {self.prog} --help)\n")


def parser(wanted: str = "") -> Parser:
    """The parser of all commands, with the options of the wanted one; the modules of the others are not imported."""
    made = Parser(prog="urbihw", description="Robots as urbiscript objects on a TCP port.")
    made.add_argument("--version", action=Version, text="urbihw {}")
    commands = made.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=Parser)
    for name, help_ in COMMANDS.items():
        command = commands.add_parser(name, help=help_)
        if name == wanted:
            module = _module(name)
            command.description = (module.__doc__ or help_).splitlines()[0]
            module.options(command)
    return made


def _module(command: str) -> Any:
    return import_module(f"urbihw.cli.{command.replace('-', '_')}")


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code."""
    words = sys.argv[1:] if argv is None else argv
    try:
        options = parser(next((word for word in words if not word.startswith("-")), "")).parse_args(words)
        code: int = _module(options.command).run(options)
    except KeyboardInterrupt:  # while modules are imported, or before a command has its own handler
        return INTERRUPTED
    return code


if __name__ == "__main__":
    sys.exit(main())
