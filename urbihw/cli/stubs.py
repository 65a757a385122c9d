"""Write a typed Python module of a robot, for editors and type checkers."""

from __future__ import annotations

import argparse
import sys
from collections import deque
from pathlib import Path
from typing import Final

from urbihw.cli.options import CliRefused, complain
from urbihw.cli.reach import add_server, credentials, server
from urbihw.client.connection import Connection
from urbihw.client.errors import ClientError
from urbihw.client.robot import Robot
from urbihw.client.stubs import stubs_text
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE
from urbihw.started import as_typed

TIMEOUT_S: Final = 10.0


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw stubs``."""
    parser.add_argument("file", type=Path, nargs="?", metavar="FILE",
                        help="module to write, such as myrobot.py (standard output)")
    add_server(parser)


def run(options: argparse.Namespace) -> int:
    """Write the module; returns the exit code."""
    try:
        _write(options.file, _told(options))
    except CliRefused as error:
        return complain("urbihw stubs", error)
    return EX_OK


def _told(options: argparse.Namespace) -> str:
    """The module of the robot of a server.  Raises CliRefused."""
    where = server(options)
    try:
        connection = Connection(where, credentials(options), TIMEOUT_S, False, lambda line, at: None)
        with Robot(connection, deque()) as robot:
            if not robot.run('Global.hasLocalSlot("robot") && System.hasSlot("treeText")'):
                status = as_typed("urbihw status")
                raise CliRefused(f"{where} has no robot: its status tells why ({status})", EX_UNAVAILABLE)
            return stubs_text(str(robot.run("System.treeText(robot)", timeout=TIMEOUT_S)))
    except (ClientError, ValueError) as error:
        raise CliRefused(str(error), EX_UNAVAILABLE) from error


def _write(file: Path | None, text: str) -> None:
    """Write the module to a file, or to standard output.  Raises CliRefused."""
    if file is None:
        sys.stdout.write(text)
        return
    if not file.stem.isidentifier() or file.suffix != ".py":
        raise CliRefused(f"{file}: Python cannot import that: choose a name such as myrobot.py", EX_CONFIG)
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CliRefused(f"{file}: {error.strerror}", EX_CONFIG) from error
