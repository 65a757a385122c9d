"""Stop a robot, or all, and let nothing move it until it is released."""

from __future__ import annotations

import argparse

from urbihw.cli import control


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw estop``."""
    control.options(parser)
    parser.add_argument(
        "--key",
        metavar="DEVICE:KEY",
        help="do so whenever a key or button is pressed, such as /dev/input/event3:KEY_SPACE, until this is ended",
    )


def run(options: argparse.Namespace) -> int:
    """Ask for it, now or at each press of a key."""
    if options.key is None:
        return control.run("estop", options)
    from urbihw.cli import estopkey

    return estopkey.run(options)
