"""How a simulated Spykee is reached: the arguments of `python -m urbihw_fakes spykee`; see `urbihw_fakes.__main__`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping

from urbihw_fakes.bodies.eye import Eye, choose_drawing
from urbihw_fakes.bodies.tracked import TrackedBody
from urbihw_fakes.console import Command
from urbihw_fakes.serving import Endpoint
from urbihw_fakes.spykee.camera import HEIGHT, WIDTH
from urbihw_fakes.spykee.console import commands
from urbihw_fakes.spykee.device import UID, Spykee
from urbihw_fakes.spykee.endpoint import SpykeeEndpoint

HELP = "a Spykee in a small room"


def options(parser: argparse.ArgumentParser) -> None:
    """The options of the simulated Spykee on the command line."""
    parser.add_argument("--tcp", type=int, required=True, metavar="PORT",
                        help="the port of control and of discovery; 0 takes a free one, a real robot has 9000")
    parser.add_argument("--address", default="127.0.0.1", help="of this machine (%(default)s)")
    parser.add_argument("--world", metavar="WORLD", help="with a body in MuJoCo: room, flat, or a file .xml")
    parser.add_argument("--uid", default=UID, help="(%(default)s)")
    parser.add_argument("--user", default="admin", help="(%(default)s)")
    parser.add_argument("--password", default="admin", help="(%(default)s)")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """The robot on its transport, and its words for the console."""
    robot = _robot(options)
    if not robot.pictures:
        print("fakes: the camera shows nothing without the Python package Pillow", file=sys.stderr)
    end = SpykeeEndpoint(robot, options.tcp, address=options.address)
    return end, commands(robot, end.clock)


def _robot(options: argparse.Namespace) -> Spykee:
    login = (options.uid, options.user, options.password)
    if options.world is None:
        return Spykee(*login)
    drawn = choose_drawing()
    body = TrackedBody(options.world)
    eye = Eye(body.simulation, "eye", WIDTH, HEIGHT)
    drawn = drawn and eye.sees()
    if not drawn:
        print("fakes: the camera shows a plain room: pictures of the world need Pillow, and EGL or OSMesa",
              file=sys.stderr)  # fmt: skip
    return Spykee(*login, body=body, look=eye.picture if drawn else None)
