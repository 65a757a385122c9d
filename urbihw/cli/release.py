"""Let a robot be moved again after an emergency stop; nothing moves by that."""

from __future__ import annotations

import argparse

from urbihw.cli import control


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw release``."""
    control.options(parser)


def run(options: argparse.Namespace) -> int:
    """Ask for it."""
    return control.run("release", options)
