"""``urbihw``: the commands of the gateway, one module each.

Exit codes: 0 success, 65 an error in urbiscript source, 69 no daemon answers, 70 an internal error, 78 a configuration
error (bad option, no robot, port in use), for which one line on standard error tells what to do, 130 after Ctrl-C,
where that is no orderly end, 141 when the reader of a pipe has closed it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any, Final, NoReturn

from urbihw.cli.entry import guarded
from urbihw.cli.options import VersionAction
from urbihw.cli.program import program
from urbihw.exitcodes import EX_CONFIG
from urbihw.started import as_typed

COMMANDS: Final = {
    "serve": "serve a robot on a TCP port",
    "stop": "stop the robot now",
    "estop": "stop the robot now and let nothing move it until it is released",
    "release": "release the robot after an emergency stop",
    "status": "show the robots that are served and their devices, one line each",
    "health": "judge the robots that are served: ok, warning or bad, with reasons",
    "monitor": "watch a robot: a live table of its devices",
    "find": "find the robots that are announced in the network",
    "config": "check settings, show those in force",
    "platforms": "list the robots that urbihw knows",
    "figure": "print the figure of a robot: links and joints, as URDF, as JSON",
    "scan": "search the serial ports for servos, or the network for robots",
    "servo": "set up single servos: id, speed, registers, backup, replacement",
    "calibrate": "calibrate the joints of a servo chain by hand",
    "console": "an interactive console of a server",
    "drive": "drive a robot by the keyboard or a gamepad",
    "panel": "serve the panel for browsers; pair, list and remove browsers",
    "mcp": "serve a robot to an assistant (MCP)",
    "fleet": "robots that are joined in a fleet: list, watch, call, stop all",
    "ros": "serve a robot as a node of ROS: its sensors as topics, and topics that move it",
    "jupyter": "make notebooks in urbiscript known to Jupyter",
    "lsp": "serve urbiscript to an editor (LSP)",
    "mqtt": "tell a broker of MQTT (Home Assistant) of a robot",
    "view": "show the simulated world of a robot in a window",
    "film": "make a film of a script in a simulated world",
    "stubs": "write a typed Python module of a robot, for editors",
    "teach": "record a motion that is shown to a robot by hand",
    "play": "play recorded motions and poses",
    "access": "manage access from the network: make, list and remove tokens",
    "dump": "show the stages of compiling urbiscript to Python",
    "doctor": "check whether this machine and its robot are well",
    "latency": "measure how long the server, a remote UObject and the bus take to answer",
    "record": "record a robot in a file: its wire, values, targets and events",
    "show": "show what happened in a recording, and why",
    "plot": "draw values of a recording in the terminal",
    "replay": "play the wire of a recording: a robot that answers as the recorded one did",
    "report": "write one file for a bug report, without secrets",
    "trace": "show the traffic of a robot's bus, decoded",
    "install-service": "install a robot as a service of systemd",
    "new-platform": "write the skeleton of a new robot into a clone of the sources",
}
"""Subcommand -> help text; each is a module beside this one with ``options(parser)`` and ``run(options)``."""


class CommandParser(argparse.ArgumentParser):
    """Reports wrong options in one line."""

    def error(self, message: str) -> NoReturn:
        """Print the error and exit with 78."""
        self.exit(EX_CONFIG, f"{self.prog}: {message} (see {as_typed(self.prog)} --help)\n")


def parser(*wanted: str) -> CommandParser:
    """The parser of all commands, with the options of the wanted ones; the modules of the others are not imported."""
    made = CommandParser(prog="urbihw", description="Robots as urbiscript objects on a TCP port.")
    made.add_argument("--version", action=VersionAction, text="urbihw {}")
    commands = made.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=CommandParser)
    for name, help_ in COMMANDS.items():
        command = commands.add_parser(name, help=help_)
        if name in wanted:
            module = _module(name)
            command.description = (module.__doc__ or help_).splitlines()[0]
            module.options(command)
    return made


def full_parser() -> CommandParser:
    """The parser with the options of all commands, of which the manual pages and the completion of shells are made."""
    return parser(*COMMANDS)


def _module(command: str) -> Any:
    return program(f"urbihw.cli.{command.replace('-', '_')}")


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code."""
    words = sys.argv[1:] if argv is None else argv

    def work() -> int:
        options = parser(next((word for word in words if not word.startswith("-")), "")).parse_args(words)
        code: int = _module(options.command).run(options)
        return code

    return guarded(work) or 0


if __name__ == "__main__":
    sys.exit(main())
