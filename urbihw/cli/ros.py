"""Serve a robot as a node of ROS 1: its joints, place and sensors as topics, and /cmd_vel and others that move it.

The master is that of ``ROS_MASTER_URI``; the node listens on the loopback interface unless ``ROS_IP`` or
``ROS_HOSTNAME`` tell otherwise (docs/ros.md).
"""

from __future__ import annotations

import argparse
import asyncio
import logging
from pathlib import Path
from typing import TYPE_CHECKING

from urbihw.cli.console import address
from urbihw.cli.options import DEFAULT_PORT, CliRefused, complain
from urbihw.cli.reach import control_by_port
from urbihw.daemon.kept_work import run_until_told
from urbihw.exitcodes import EX_CONFIG, EX_OK
from urbihw.extras import install_command

if TYPE_CHECKING:
    from urbihw.ros.robot.bridge import RosRobotSettings


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw ros``."""
    parser.add_argument("server", nargs="?", type=address, default=(None, DEFAULT_PORT), metavar="HOST:PORT",
                        help=f"address of the server, or path of its UNIX socket (this machine, {DEFAULT_PORT})")
    parser.add_argument("--control", type=Path, metavar="PATH",
                        help="control socket of the robot (default: by the port, none for a path)")
    parser.add_argument("--node", default="", metavar="NAME", help="name of the node (urbihw_ and that of the robot)")
    parser.add_argument("--child", action="store_true",
                        help="end when standard input ends, for a program that starts this")


def run(options: argparse.Namespace) -> int:
    """Serve until the user or the daemon ends it; returns the exit code."""
    logging.basicConfig(format="urbihw: ros: %(message)s", level=logging.INFO)
    try:
        from urbihw.ros.errors import RosError
        from urbihw.ros.robot.bridge import RosRobot

        async def serve() -> None:
            await run_until_told(RosRobot(_settings(options)).run(), ends_with_input=options.child)

        asyncio.run(serve())
    except ImportError as error:
        if (error.name or "").partition(".")[0] != "rosbags":
            raise
        return complain("urbihw ros", CliRefused(f"this needs a package: {install_command('ros')}", EX_CONFIG))
    except RosError as error:
        return complain("urbihw ros", CliRefused(str(error), EX_CONFIG))
    return EX_OK


def _settings(options: argparse.Namespace) -> RosRobotSettings:
    from urbihw.ros.robot.bridge import RosRobotSettings

    host, port = options.server
    control = options.control or (None if options.child else control_by_port(host, port))
    return RosRobotSettings(host or "127.0.0.1", port, control, options.node)
