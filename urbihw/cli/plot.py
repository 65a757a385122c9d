"""Draw values of a recording as curves in the terminal, one below the other."""

from __future__ import annotations

import argparse
import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from urbihw.cli.options import CliRefused, complain
from urbihw.cli.show import joint_ids, seconds
from urbihw.exitcodes import EX_NOINPUT, EX_OK
from urbihw.recording.drawing import draw
from urbihw.recording.reading import Recording, UnreadableRecording
from urbihw.recording.table import curves

MOST_LINES: Final = 12
LEAST_LINES: Final = 5
"""Lines of one curve, with its name."""


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw plot``."""
    parser.add_argument("file", type=Path, metavar="FILE", help="a recording of urbihw record")
    parser.add_argument("values", nargs="+", metavar="NAME",
                        help="what to draw: 6.position, motor6.position, gripper.position, or 6 for all of a device")
    parser.add_argument("--from", type=seconds, default=-math.inf, dest="since", metavar="TIME",
                        help="from so many seconds after the beginning")
    parser.add_argument("--to", type=seconds, default=math.inf, dest="until", metavar="TIME", help="up to this time")
    parser.add_argument("--raw", action="store_true", help="the raw counts of every tick instead of SI units")


def run(options: argparse.Namespace) -> int:
    """Draw; returns the exit code."""
    try:
        recording = Recording(options.file)
        ids = joint_ids(recording)
        wanted = [column_of(name, ids) for name in options.values]
        found = curves(recording, wanted, options.since, options.until, raw=options.raw)
    except UnreadableRecording as error:
        return complain("urbihw plot", CliRefused(str(error), EX_NOINPUT))
    times = [time for curve in found.values() for time, _ in curve]
    since, until = min(times, default=0.0), max(times, default=0.0)
    columns, lines = shutil.get_terminal_size()
    high = max(LEAST_LINES, min(MOST_LINES, (lines - 2) // max(len(found), 1)))
    for name, curve in found.items():
        print(*draw(name, curve, since, until, columns - 1, high), sep="\n")
    print(f"{'':10}{since:.3f} s to {until:.3f} s")
    return EX_OK


def column_of(name: str, ids: Mapping[str, str]) -> str:
    """The name of a value as recordings have it: a joint by its id, as are ``motor6`` and ``sensor100``."""
    device, dot, item = name.partition(".")
    number = device.removeprefix("motor").removeprefix("sensor")
    return ids.get(device, number if number.isdecimal() else device) + dot + item
