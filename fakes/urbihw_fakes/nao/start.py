"""How a simulated Nao is reached: the arguments of `python -m urbihw_fakes nao`; see `urbihw_fakes.__main__`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

from urbihw_fakes.console import Command
from urbihw_fakes.nao.console import commands
from urbihw_fakes.nao.device import Nao
from urbihw_fakes.nao.endpoint import NaoEndpoint
from urbihw_fakes.serving import Endpoint

HELP = "a Nao with NAOqi 2"


def options(parser: argparse.ArgumentParser) -> None:
    """Its options."""
    parser.add_argument(
        "--tcp", type=int, required=True, metavar="PORT", help="its port; 0 takes a free one, a real robot has 9559"
    )
    parser.add_argument("--user", default="", help="who may come in; anybody without it")
    parser.add_argument("--password", default="", help="of that user")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """The robot on its transport, and its words for the console."""
    robot = Nao(options.user, options.password)
    end = NaoEndpoint(robot, options.tcp)
    return end, commands(robot, end.clock)
