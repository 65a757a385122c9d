"""Print the figure of a robot: its links and joints, as a list, a URDF or JSON."""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path

from urbihw import platforms
from urbihw.exitcodes import EX_CONFIG
from urbihw.figure import BadFigure, Figure, FigureLink
from urbihw.figure.model import FILE, figure_file, read
from urbihw.figure.urdf import to_urdf
from urbihw.kernel.uobject import BadConfig


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw figure``."""
    parser.add_argument("figure", metavar="PLATFORM", help=f"a robot of `urbihw platforms`, or the path of a {FILE}")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--urdf", action="store_true", help="as URDF, for ROS, PyBullet, Pinocchio, viewers")
    form.add_argument("--json", action="store_true", help="for programs")


def run(options: argparse.Namespace) -> int:
    """Print the figure of a platform or of a file."""
    name = Path(options.figure).stem if options.figure.endswith(".toml") else options.figure
    try:
        figure = _figure(options.figure)
    except (BadConfig, BadFigure) as error:
        print(f"urbihw: {error}", file=sys.stderr)
        return EX_CONFIG
    if options.urdf:
        print(to_urdf(figure, name), end="")
    elif options.json:
        print(json.dumps(figure.as_table(), indent=2))
    else:
        for link in figure.links:
            print(_line(figure, link))
    return 0


def _figure(asked: str) -> Figure:
    """The figure of a platform by name, or of a file.  Raises BadConfig, BadFigure."""
    if asked.endswith(".toml"):
        return read(Path(asked))
    path = figure_file(platforms.find(asked).folder / FILE)
    if path is None:
        raise BadConfig(f"platform {asked} has no figure: what it has is known only when it runs (robot.figure.text)")
    return read(path)


def _line(figure: Figure, link: FigureLink) -> str:
    """A link as a line, under the one that carries it."""
    told = "  " * (len(figure.chain(link.name)) - 1) + link.name
    joint = link.joint
    if joint is None:
        return told + (f": {link.device}" if link.device else "")
    axis = " ".join(f"{share:g}" for share in joint.axis)
    ends = "" if math.isinf(joint.low) else f", {joint.low:g} to {joint.high:g} {joint.unit}"
    return f"{told}: joint {joint.device or link.name} about {axis}{ends}"
