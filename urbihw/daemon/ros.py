"""The robot as a node of ROS (``urbihw.ros.robot``) as a child of the daemon: a client like any other."""

from __future__ import annotations

import sys
from importlib.util import find_spec

from urbihw.daemon.config import Config
from urbihw.extras import install_command
from urbihw.kernel.uobject import BadConfig


def check_ros() -> None:
    """Whether there can be a node.  Raises BadConfig."""
    if find_spec("rosbags") is None:
        raise BadConfig(f"ros: this needs a package: {install_command('ros')}")


def ros_command(config: Config, server: str, control: str) -> list[str]:
    """The command line of the node of a daemon.  ``server`` is its address or socket, ``control`` the socket of the
    worker, "" for none."""
    command = [sys.executable, "-m", "urbihw.cli.main", "ros", server, "--child"]
    return [*command, "--control", control] if control else command
