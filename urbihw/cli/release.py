"""Release a robot after an emergency stop, so that programs can move it again; the release itself moves nothing.

Each who has pressed an emergency stop holds the robot until his own release.
"""

from __future__ import annotations

import argparse

from urbihw.cli import control


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw release``."""
    control.options(parser)
    parser.add_argument(
        "--of", metavar="NAME", action="append", default=[], help="release the emergency stop of NAME, too"
    )
    parser.add_argument("--all", action="store_true", help="release the emergency stops of all who have pressed one")


def run(options: argparse.Namespace) -> int:
    """Ask the workers to release the emergency stop; returns the exit code."""
    return control.run("release", options)
