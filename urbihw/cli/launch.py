"""``urbi-launch``: run UObjects, in a new server, in a running one, or beside one (manual, section 18.5).

The modules are Python files, where the manual has shared libraries; they are looked for in ``URBI_UOBJECT_PATH``.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from urbihw.cli import logs, urbi
from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import DEFAULT_PORT, CliRefused, GetoptParser, complain, port, split
from urbihw.cli.reach import add_access, credentials, server
from urbihw.client.credentials import Credentials
from urbihw.client.where import Where
from urbihw.exitcodes import EX_CONFIG, EX_USAGE, INTERRUPTED
from urbihw.kernel.server.exit_watchdog import leave

PROGRAM: Final = "urbi-launch"
LOAD_TIMEOUT_S: Final = 10.0
"""Maximum seconds for a server to load a module."""


def parser() -> GetoptParser:
    """The options before ``--``."""
    usage = "%(prog)s [OPTION...] MODULE... [-- MODULE-OPTION...]"
    made = GetoptParser(
        PROGRAM,
        "Run Python modules of UObjects; behind -- stand the options of urbi (with --start) or of the modules.",
        usage,
    )
    made.add_argument("-c", "--customize", metavar="FILE", help="not supported: a server of one's own, in C++")
    made.add_argument("-d", "--debug", type=logs.level, metavar="LEVEL",
                      help=f"what to log: {', '.join(logs.LEVELS)} (GD_LEVEL, or LOG)")
    mode = made.add_argument_group("mode").add_mutually_exclusive_group()
    for short, name, what in (
        ("-p", "plugin", "load the modules into the running server at HOST and PORT"),
        ("-r", "remote", "run the modules in this process, connected to the server at HOST and PORT"),
        ("-s", "start", "start a server with the modules (the default)"),
    ):
        mode.add_argument(short, f"--{name}", dest="mode", action="store_const", const=name, help=what)
    made.set_defaults(mode="start")
    network = made.add_argument_group("networking")
    network.add_argument("-H", "--host", help="address to connect to or to listen on (127.0.0.1)")
    network.add_argument("-P", "--port", metavar="PORT", help=f"port to connect to ({DEFAULT_PORT}) or to listen on")
    network.add_argument("--port-file", type=Path, metavar="FILE",
                         help="the port to connect to is in FILE; with --start, it is written there")
    add_access(network)
    made.add_argument("modules", nargs="*", metavar="MODULE", help="a Python module, without or with .py")
    return made


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code."""
    own, behind = split(sys.argv[1:] if argv is None else argv)
    made = parser()
    options = made.parse(own)
    logs.set_up(PROGRAM, options.debug, os.environ)
    try:
        if options.customize is not None:
            raise CliRefused("--customize wants a server in C++, which this is not; leave it out", EX_CONFIG)
        if options.mode == "start":
            words = [*server_options(options), *behind]
            return urbi.run(words, PROGRAM, options.modules, *([leave] if argv is None else []))
        if not options.modules:
            made.error("which module? Give one or several, without extension")
        where, who = server_of(options), credentials(options)
        if options.mode == "plugin":
            return plug(where, who, options.modules)
        from urbihw.remote import run

        if where.tls:
            LobbyClient(where, who).close()  # asks the user all questions
        return run(options.modules, where.host, where.port, tls=where.tls, credentials=who, arguments=behind)
    except CliRefused as error:
        return complain(PROGRAM, error)
    except KeyboardInterrupt:
        return INTERRUPTED


def server_options(options: argparse.Namespace) -> list[str]:
    """The options for ``urbi`` among those of ``urbi-launch``."""
    given = (("host", options.host), ("port", options.port), ("port-file", options.port_file), ("debug", options.debug))
    return [f"--{name}={value}" for name, value in given if value is not None]


def server_of(options: argparse.Namespace) -> Where:
    """The address of the running server.  Raises CliRefused."""
    try:
        options.port = DEFAULT_PORT if options.port is None else port(options.port)
    except argparse.ArgumentTypeError as error:
        raise CliRefused(str(error), EX_USAGE) from None
    return server(options)


def plug(where: Where, who: Credentials, modules: Sequence[str]) -> int:
    """Make a running server load modules, which it searches in its own ``URBI_UOBJECT_PATH``."""
    with LobbyClient(where, who) as link:
        for module in modules:
            escaped = module.replace("\\", "\\\\").replace('"', '\\"')
            link.ask(f'loadModule("{escaped}") | 1', LOAD_TIMEOUT_S)
    return 0


if __name__ == "__main__":
    sys.exit(main())
