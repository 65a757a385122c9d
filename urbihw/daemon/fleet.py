"""The bridge to a fleet (``urbihw.fleets``) as a child of the daemon.

It is a process of its own: its death costs no tick, and a stop for all reaches the bus worker whatever the interpreter
does.
"""

from __future__ import annotations

import socket
import sys
from importlib.util import find_spec

from urbihw.daemon.config import Config
from urbihw.extras import install_command
from urbihw.fleets.names import fleet_name_of
from urbihw.kernel.uobject import BadConfig


def check_fleet() -> None:
    """Whether there can be a bridge.  Raises BadConfig."""
    if find_spec("zenoh") is None:
        raise BadConfig(f"fleet: this needs a package: {install_command('fleet')}")


def fleet_command(config: Config, server: str, control: str) -> list[str]:
    """The command line of the bridge of a daemon.  ``server`` is its address or socket, ``control`` the socket of the
    worker."""
    name = config.name or fleet_name_of(socket.gethostname())
    command = [sys.executable, "-m", "urbihw.cli.main", "fleet", "bridge", server, "--child", "--control", control,
               "--fleet", config.fleet, "--name", name, "--endpoint", config.fleet_endpoint,
               "--platform", config.platform, "--hz", f"{config.fleet_hz:g}",
               "--dead-man", f"{config.fleet_dead_man:g}"]
    for each in config.fleet_drive:
        command += ["--drive", each]
    return command
