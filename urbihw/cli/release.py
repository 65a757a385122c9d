"""Release a robot after an emergency stop, so that programs can move it again; the release itself moves nothing."""

from __future__ import annotations

import argparse

from urbihw.cli import control


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw release``."""
    control.options(parser)


def run(options: argparse.Namespace) -> int:
    """Ask the workers to release the emergency stop; returns the exit code."""
    return control.run("release", options)
