"""Talk to a server: history, editing, colours, completion, help.

Reading order: ``session`` (the connection and its reconnection), ``assistant`` and ``assistant.u`` (queries of the
console on a connection of its own), ``subject`` (the expression before the cursor), ``lexer`` and ``colours``
(highlighting of urbiscript and answers), ``completion``, ``help``, ``screen`` (the prompt), ``prompt_printer`` (output
above the prompt), ``plain`` (the console in a pipe).

``plain`` and its imports work without prompt_toolkit and Pygments (extra ``console``).
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
from importlib.util import find_spec

from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import DEFAULT_PORT, CliRefused, complain, port
from urbihw.cli.reach import add_access, credentials, resolve_server
from urbihw.exitcodes import EX_CONFIG, INTERRUPTED
from urbihw.extras import install_command

NEEDED = ("prompt_toolkit", "pygments")


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw console``."""
    parser.add_argument("server", nargs="?", type=address, default=(None, DEFAULT_PORT), metavar="HOST:PORT",
                        help=f"address of the server, or path of its UNIX socket (this machine, {DEFAULT_PORT})")
    add_access(parser)
    parser.add_argument("--plain", action="store_true",
                        help="no editing and no colours, as if input or output were no terminal, or a dumb one")


def address(text: str) -> tuple[str | None, int]:
    """Parse ``HOST``, ``HOST:PORT``, ``:PORT``, ``[IPv6]:PORT``, a port alone, or a path with a ``/``; without a host
    it is None."""
    if "/" in text:
        return text, DEFAULT_PORT
    if text.isdigit():
        host, number = "", text
    elif text.startswith("["):
        host, _, number = text[1:].partition("]")
        number = number.removeprefix(":")
    else:
        host, _, number = text.partition(":")
    try:
        return host or None, port(number) if number else DEFAULT_PORT
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(f"{text!r} is no address; give HOST:PORT, such as robot:54000") from None


def run(options: argparse.Namespace) -> int:
    """Run the console until Ctrl-D or ``quit;``, or until all statements of the input have run."""
    try:
        host, number = options.server
        where, who = resolve_server(host, number, options.tls), credentials(options)
        if options.plain or not (sys.stdin.isatty() and sys.stdout.isatty()) or os.environ.get("TERM") == "dumb":
            from urbihw.cli.console import plain

            return plain.run_session(where, who, sys.stdin.buffer)
        missing = [name for name in NEEDED if find_spec(name) is None]
        if missing:
            raise CliRefused(f"this needs {' and '.join(missing)}: {install_command('console')}; or use --plain",
                             EX_CONFIG)
        from urbihw.cli.console import screen

        if where.tls:
            LobbyClient(where, who).close()  # Asks the user all questions, before the prompt has the terminal.
        return asyncio.run(screen.run_session(where, who, os.environ))
    except CliRefused as error:
        return complain("urbihw console", error)
    except KeyboardInterrupt:
        return INTERRUPTED
