"""Search the network for robots of one kind, and print one line for each, with its url."""

from __future__ import annotations

import argparse
import sys

from urbihw import platforms
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE
from urbihw.kernel.uobject import BadConfig


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw scan``."""
    parser.add_argument("platform", help="the kind of robot; only spykee supports a search")


def run(options: argparse.Namespace) -> int:
    """Print each robot when it answers."""
    count = 0
    try:
        for robot in platforms.scan(platforms.find(options.platform)):
            count += 1
            print(robot, flush=True)
    except BadConfig as error:
        print(f"urbihw: {error}", file=sys.stderr)
        return EX_CONFIG
    except OSError as error:
        print(f"urbihw: cannot look for robots: {error.strerror}; is there a network?", file=sys.stderr)
        return EX_UNAVAILABLE
    if not count:
        print(f"urbihw: no {options.platform} answers; is it switched on, and this computer in its network?",
              file=sys.stderr)  # fmt: skip
        return EX_UNAVAILABLE
    return EX_OK
