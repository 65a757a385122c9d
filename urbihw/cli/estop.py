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
        help="stop at each press of a key or button, such as /dev/input/event3:KEY_SPACE, until the command ends",
    )


def run(options: argparse.Namespace) -> int:
    """Request the emergency stop, now or at each press of a key."""
    if options.key is None:
        return control.run("estop", options)
    from urbihw.cli import estopkey

    return estopkey.run(options)
