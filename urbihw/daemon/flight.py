"""The flight recorder as a child of the daemon.

It keeps the last minutes in memory, and writes them when something goes wrong, also when the daemon is killed.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec
from typing import Final

from urbihw.daemon.config import Config
from urbihw.daemon.state import recordings_folder
from urbihw.extras import install_command
from urbihw.kernel.uobject import BadConfig

FAREWELL: Final = b"end"
"""What the daemon says before it ends in order."""


def check_flight() -> None:
    """Whether there can be a flight recorder.  Raises BadConfig."""
    if find_spec("mcap") is None:
        raise BadConfig(f"flight: this needs a package: {install_command('recording')}")


def flight_command(config: Config, control: str) -> list[str]:
    """The command line of the flight recorder of a daemon; ``control`` is the socket of its worker."""
    folder = recordings_folder() / config.platform
    return [sys.executable, "-m", "urbihw.cli.main", "record", "--flight", f"{config.flight:g}", "--socket", control,
            "--platform", config.platform, "--folder", str(folder)]
