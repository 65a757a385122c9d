"""Where the daemon keeps what lasts as long as it runs: the sockets of its clients and of its bus workers."""

from __future__ import annotations

import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from urbihw.kernel.uobject import BadConfig

SERVICE_FOLDER: Final = Path("/run/urbihw")
"""RuntimeDirectory of the unit in share/."""


def runtime_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder of the sockets, made if need be.

    Under systemd that of the unit (RUNTIME_DIRECTORY), else one of the user's own: in XDG_RUNTIME_DIR, or for a system
    without it one in the folder for temporary files that nobody else may write.  Raises BadConfig if somebody else can.
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
    """Where the control socket of a robot is that a daemon on ``port`` serves.  Raises BadConfig."""
    return runtime_folder(environment) / f"{platform}-{port}.sock"


def control_sockets(environment: Mapping[str, str] = os.environ) -> list[Path]:
    """All control sockets that this user can find, those of the service last."""
    folders = [runtime_folder(environment), SERVICE_FOLDER]
    return [path for folder in dict.fromkeys(folders) for path in sorted(folder.glob("*.sock"))]


def client_path(port: int, environment: Mapping[str, str] = os.environ) -> Path:
    """Where the UNIX socket for clients is of a daemon on ``port``.  Raises BadConfig."""
    return runtime_folder(environment) / f"urbi-{port}.socket"


def client_sockets(port: int, environment: Mapping[str, str] = os.environ) -> list[Path]:
    """The UNIX sockets for clients of daemons on ``port`` that this user can find, that of the service last.

    Raises BadConfig.
    """
    folders = [runtime_folder(environment), SERVICE_FOLDER]
    return [path for folder in dict.fromkeys(folders) for path in folder.glob(f"urbi-{port}.socket")]


# ``urbihw estop`` needs this module in a hurry: what takes long to import is imported when it is needed.


def _temporary() -> Path:
    import tempfile

    return Path(tempfile.gettempdir())


def _bad(text: str) -> BadConfig:
    from urbihw.kernel.uobject import BadConfig

    return BadConfig(text)
