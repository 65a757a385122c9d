"""Stop a robot, or all, and let nothing move it until it is released."""

from __future__ import annotations

import argparse

from urbihw.cli import control


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw estop``."""
    control.options(parser)


def run(options: argparse.Namespace) -> int:
    """Ask for it."""
    return control.run("estop", options)
