"""Serve urbiscript to an editor by the Language Server Protocol, on standard input and output.

The editor starts it. Names and help come from a robot, if one is named. It needs the extra `lsp`.
"""

from __future__ import annotations

import argparse
import json
import os
import sys

from urbihw.cli.options import CliRefused, complain
from urbihw.cli.reach import add_server, credentials, server
from urbihw.exitcodes import EX_CONFIG, EX_OK
from urbihw.extras import install_command


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw lsp``."""
    parser.add_argument("--grammar", action="store_true",
                        help="print the TextMate grammar, by which editors colour urbiscript, and end")
    parser.add_argument("--offline", action="store_true", help="ask no robot")
    add_server(parser)


def run(options: argparse.Namespace) -> int:
    """Serve until the editor ends it; returns the exit code."""
    if options.grammar:
        from urbihw.neighbours.editor.textmate import grammar

        json.dump(grammar(), sys.stdout, indent=1)
        print()
        return EX_OK
    try:
        from urbihw.neighbours.editor.server import RobotNames, make_server
    except ImportError:
        return complain("urbihw lsp", CliRefused(f"it needs the extra lsp: {install_command('lsp')}", EX_CONFIG))
    try:
        robot = None if options.offline else RobotNames(server(options), credentials(options))
    except CliRefused as error:
        return complain("urbihw lsp", error)
    # It closes what it reads and writes; the rest of this process has still to write.
    with os.fdopen(os.dup(sys.stdin.fileno()), "rb") as said, os.fdopen(os.dup(sys.stdout.fileno()), "wb") as answers:
        make_server(robot).start_io(said, answers)
    return EX_OK
