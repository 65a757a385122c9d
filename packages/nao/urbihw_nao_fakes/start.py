"""How a simulated Nao is reached: the arguments of `python -m urbihw_fakes nao`; see `urbihw_fakes.__main__`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from urbihw_fakes.console import Command
from urbihw_fakes.errors import FakeError
from urbihw_fakes.serving import Endpoint
from urbihw_nao_fakes.console import commands, in_world
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.endpoint import NaoEndpoint
from urbihw_nao_fakes.legged import LeggedBody
from urbihw_nao_fakes.tls import Identity

HELP = "a Nao with NAOqi 2"


def options(parser: argparse.ArgumentParser) -> None:
    """The options of the simulated Nao on the command line."""
    parser.add_argument(
        "--tcp", type=int, required=True, metavar="PORT", help="its port; 0 takes a free one, a real robot has 9559"
    )
    parser.add_argument("--user", default="", help="who may come in; anybody without it")
    parser.add_argument("--password", default="", help="of that user")
    parser.add_argument("--watchdog", type=Path, metavar="FILE", help="urbihw's program on the robot, watchdog.py")
    parser.add_argument("--world", metavar="WORLD", help="with a body in MuJoCo: room, flat, or a file .xml")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--tls", action="store_true", help="encrypted, as NAOqi 2.9; with a certificate made now")
    form.add_argument("--libqi", action="store_true", help="behind a session of libqi itself (PyPI qi)")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """The robot on its transport, and its words for the console."""
    body = None if options.world is None else LeggedBody(options.world)
    robot = Nao(options.user, options.password, body=body)
    if options.watchdog is not None:
        robot.add_watchdog(options.watchdog)
    end = _make_endpoint(robot, options)
    words = commands(robot, end.clock)
    return end, words if body is None else in_world(robot, body, words, end.clock)


def _make_endpoint(robot: Nao, options: argparse.Namespace) -> Endpoint:
    if not options.libqi:
        return NaoEndpoint(robot, options.tcp, identity=Identity() if options.tls else None)
    if options.user:
        raise FakeError("--libqi asks for no password: without --user, please")
    # Imported here: the package is not everywhere, and loads slowly.
    from urbihw_nao_fakes.libqi import LibqiEndpoint

    return LibqiEndpoint(robot, options.tcp)
