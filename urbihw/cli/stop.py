"""Stop a robot, or all: speeds go to zero, joints hold; later commands move it again."""

from __future__ import annotations

import argparse
from pathlib import Path

from urbihw.cli import control
from urbihw.exitcodes import EX_CONFIG


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw stop``."""
    control.options(parser)
    parser.add_argument("--direct", action="store_true", help="open the robot's bus if no daemon answers")
    parser.add_argument("--config", type=Path, metavar="FILE", help="with --direct: the settings of the daemon")
    parser.add_argument("--platform", metavar="NAME", help="with --direct: which robot")
    parser.add_argument("--url", help="with --direct: its bus")


def run(options: argparse.Namespace) -> int:
    """Request the stop, or stop the robot directly."""
    if options.direct:
        from urbihw.cli.direct import stop

        return stop(options)
    for name in ("config", "platform", "url"):
        if getattr(options, name) is not None:
            return control.complain(f"--{name} is for --direct; a robot that is served has a --socket", EX_CONFIG)
    return control.run("stop", options)
