"""The runtime folder of the daemon: the sockets for its clients and of its bus workers."""

from __future__ import annotations

import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from urbihw.kernel.uobject import BadConfig

SERVICE_FOLDER: Final = Path("/run/urbihw")
"""The RuntimeDirectory of the unit in urbihw/share."""


def runtime_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder of the sockets, which is created if needed.

    Under systemd it is that of the unit (RUNTIME_DIRECTORY), otherwise a folder of the user: in XDG_RUNTIME_DIR, or on
    a system without it a private one in the folder for temporary files.  Raises BadConfig if other users can write
    there.
    """
    if environment.get("RUNTIME_DIRECTORY"):
        return Path(environment["RUNTIME_DIRECTORY"].split(":")[0])
    home = environment.get("XDG_RUNTIME_DIR")
    folder = Path(home) / "urbihw" if home else _temporary() / f"urbihw-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        about = folder.lstat()
    except OSError as error:
        raise _bad(f"no folder for sockets: {folder}: {error.strerror}; set control and socket") from error
    if not stat.S_ISDIR(about.st_mode) or about.st_uid != os.getuid() or about.st_mode & 0o022:
        raise _bad(f"{folder} belongs to somebody else or can be written by others: remove it, or set control, socket")
    return folder


def control_path(platform: str, port: int, environment: Mapping[str, str] = os.environ) -> Path:
    """The path of the control socket of the robot that a daemon on ``port`` serves.  Raises BadConfig."""
    return runtime_folder(environment) / f"{platform}-{port}.sock"


def control_sockets(environment: Mapping[str, str] = os.environ) -> list[Path]:
    """The paths of all control sockets that this user can find, those of the service last."""
    folders = [runtime_folder(environment), SERVICE_FOLDER]
    return [path for folder in dict.fromkeys(folders) for path in sorted(folder.glob("*.sock"))]


def client_path(port: int, environment: Mapping[str, str] = os.environ) -> Path:
    """The path of the UNIX socket for clients of a daemon on ``port``.  Raises BadConfig."""
    return runtime_folder(environment) / f"urbi-{port}.socket"


def client_sockets(port: int, environment: Mapping[str, str] = os.environ) -> list[Path]:
    """The paths of the client sockets of daemons on ``port`` that this user can find, that of the service last.

    Raises BadConfig.
    """
    folders = [runtime_folder(environment), SERVICE_FOLDER]
    return [path for folder in dict.fromkeys(folders) for path in folder.glob(f"urbi-{port}.socket")]


# ``urbihw estop`` needs this module quickly: modules that import slowly are imported on use.


def _temporary() -> Path:
    import tempfile

    return Path(tempfile.gettempdir())


def _bad(text: str) -> BadConfig:
    from urbihw.kernel.uobject import BadConfig

    return BadConfig(text)
