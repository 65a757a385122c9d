"""The gateway for browsers (``urbihw.web``) as a child of the daemon.

It is a process of its own, so that a held interpreter leaves the panel alive.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec

from urbihw.daemon.config import Config
from urbihw.extras import install_command
from urbihw.kernel.uobject import BadConfig


def check_panel(config: Config) -> None:
    """Whether there can be a panel.  Raises BadConfig."""
    if find_spec("aiohttp") is None or find_spec("segno") is None:
        raise BadConfig(f"web: this needs a package: {install_command('web')}")


def panel_command(config: Config, server: str, control: str) -> list[str]:
    """The command line of the gateway of a daemon.  ``server`` is its address or socket, ``control`` the socket of the
    worker, "" for none."""
    command = [sys.executable, "-m", "urbihw.cli.main", "panel", server, "--child", "--host", config.panel_host,
               "--port", str(config.panel_port), "--platform", config.platform, "--speed", f"{config.panel_speed:g}"]
    if control:
        command += ["--control", control]
    if config.fake:
        command.append("--fake")
    if config.tls_cert:
        command += ["--tls-cert", config.tls_cert]
    if config.tls_key:
        command += ["--tls-key", config.tls_key]
    return command
