"""How `python -m urbihw_fakes so101` is started; see `urbihw_fakes.__main__`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

from urbihw_fakes.console import Command
from urbihw_fakes.feetech.start import serve, wire_options
from urbihw_fakes.serving import Endpoint
from urbihw_fakes.so101.arm import JOINTS, So101

HELP = "an SO-101 arm: six STS3215 (1..6), follower or leader"


def options(parser: argparse.ArgumentParser) -> None:
    """The options of the simulated arm on the command line."""
    wire_options(parser)
    parser.add_argument("--calibrated", action="store_true", help="the middle of each joint reads 2048 already")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """The arm on its transport, and its words for the console."""
    arm = So101(calibrated=options.calibrated)
    return serve(options, arm, {name: joint.id for name, joint in JOINTS.items()})
