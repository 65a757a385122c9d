"""Serve a robot to an assistant by the Model Context Protocol, on standard input and output.

The assistant's program starts it.  It needs the extra `mcp`.
"""

from __future__ import annotations

import argparse

from urbihw.cli.entry import PIPE_CLOSED
from urbihw.cli.options import CliRefused, complain, number
from urbihw.cli.reach import add_server, credentials, server
from urbihw.exitcodes import EX_CONFIG, EX_OK, INTERRUPTED
from urbihw.extras import install_command
from urbihw.neighbours.assistant.settings import ROLES, AssistantSettings
from urbihw.neighbours.orders import OrderSettings


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw mcp``."""
    add_server(parser)
    parser.add_argument("--role", choices=ROLES, default="view",
                        help="of the assistant: look and stop; move slowly, too; run urbiscript, too (%(default)s)")
    parser.add_argument("--ask", action=argparse.BooleanOptionalAction, default=True,
                        help="ask the person before each movement, where the assistant's program can (the default)")
    parser.add_argument("--lease", type=number(0.1, 3600, "lease"), default=1.0, metavar="SECONDS",
                        help="what moves stands when this program is held for so long (%(default)s)")


def run(options: argparse.Namespace) -> int:
    """Serve until standard input ends; returns the exit code."""
    try:
        where = server(options)
    except CliRefused as error:
        return complain("urbihw mcp", error)
    try:
        from urbihw.neighbours.assistant.server import make_server
    except ImportError:
        return complain("urbihw mcp", CliRefused(f"it needs the extra mcp: {install_command('mcp')}", EX_CONFIG))
    settings = AssistantSettings(
        OrderSettings(where, credentials(options), "assistant", options.lease), options.role, options.ask
    )
    code = EX_OK
    try:
        make_server(settings).run("stdio")
    except* KeyboardInterrupt:
        code = INTERRUPTED
    except* BrokenPipeError:  # the assistant's program was killed
        code = PIPE_CLOSED
    return code
