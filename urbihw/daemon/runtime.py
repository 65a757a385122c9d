"""The runtime folder of the daemon: the sockets for its clients and of its bus workers.

A bus worker listens at the file of its control socket, and at an abstract socket named after that file: a stop reaches
it even if the file was deleted.  ``urbihw estop`` needs this module quickly, and imports take most of its time: so
modules that import slowly, also ``typing`` and ``pathlib``, are imported where they are used.
"""

from __future__ import annotations

import os
import stat

from urbihw.control_address import PREFIX

TYPE_CHECKING = False  # as ``typing`` has it: type checkers know the name
if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from typing import Final

    from urbihw.kernel.uobject import BadConfig

SERVICE_FOLDER: Final = "/run/urbihw"
"""The RuntimeDirectory of the unit in urbihw/share."""
BOUND_SOCKETS: Final = "/proc/net/unix"
"""The bound UNIX sockets of the system; the last of eight fields is the path, or "@" and an abstract name."""


def runtime_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder of the sockets, which is created if needed.

    Under systemd it is that of the unit (RUNTIME_DIRECTORY), otherwise a folder of the user: in XDG_RUNTIME_DIR, or on
    a system without it a private one in the folder for temporary files.  Raises BadConfig if other users can write
    there.
    """
    from pathlib import Path

    return Path(_runtime_folder_name(environment))


def _runtime_folder_name(environment: Mapping[str, str]) -> str:
    if environment.get("RUNTIME_DIRECTORY"):
        return environment["RUNTIME_DIRECTORY"].split(":")[0]
    home = environment.get("XDG_RUNTIME_DIR")
    folder = os.path.join(home, "urbihw") if home else os.path.join(_temporary_folder(), f"urbihw-{os.getuid()}")
    try:
        os.makedirs(folder, 0o700, exist_ok=True)
        about = os.lstat(folder)
    except OSError as error:
        raise _bad(f"no folder for sockets: {folder}: {error.strerror}; set control and socket") from error
    if not stat.S_ISDIR(about.st_mode) or about.st_uid != os.getuid() or about.st_mode & 0o022:
        raise _bad(f"{folder} belongs to somebody else or can be written by others: remove it, or set control, socket")
    return folder


def control_path(platform: str, port: int, environment: Mapping[str, str] = os.environ) -> Path:
    """The path of the control socket of the robot that a daemon on ``port`` serves.  Raises BadConfig."""
    return runtime_folder(environment) / f"{platform}-{port}.sock"


def control_sockets(environment: Mapping[str, str] = os.environ) -> list[Path]:
    """The paths of all control sockets that this user can find, those of the service last.  Raises BadConfig."""
    from pathlib import Path

    return [Path(name) for name in control_socket_names(environment)]


def control_socket_names(environment: Mapping[str, str] = os.environ) -> list[str]:
    """The same as texts, without the cost of ``pathlib``; also those whose file was deleted.  Raises BadConfig."""
    return _names_in(_runtime_folder_name(environment), os.fspath(SERVICE_FOLDER))


def service_socket_names() -> list[str]:
    """The names of the sockets in the folder of the service."""
    return _names_in(os.fspath(SERVICE_FOLDER))


def _names_in(*folders: str) -> list[str]:
    names: dict[str, None] = {}
    unlisted = _abstract_names()
    for folder in dict.fromkeys(folders):
        try:
            found = {os.path.join(folder, name) for name in os.listdir(folder) if name.endswith(".sock")}
        except OSError:
            found = set()
        found |= {name for name in unlisted if os.path.dirname(name) == os.path.abspath(folder)}
        names |= dict.fromkeys(sorted(found))
    return list(names)


def _abstract_names() -> list[str]:
    """The paths after which workers have named their abstract sockets."""
    try:
        with open(BOUND_SOCKETS, encoding="utf-8", errors="surrogateescape") as file:
            rows = [line.rstrip("\n").split(None, 7) for line in file]
    except OSError:
        return []
    mark = f"@{PREFIX}"
    return [row[7].removeprefix(mark) for row in rows if len(row) == 8 and row[7].startswith(mark)]


def client_path(port: int, environment: Mapping[str, str] = os.environ) -> Path:
    """The path of the UNIX socket for clients of a daemon on ``port``.  Raises BadConfig."""
    return runtime_folder(environment) / f"urbi-{port}.socket"


def client_sockets(port: int | str, environment: Mapping[str, str] = os.environ) -> list[Path]:
    """The paths of the client sockets of daemons on ``port`` ("*": any) that this user can find.

    Those of the service come last.  Raises BadConfig.
    """
    from pathlib import Path

    folders = [runtime_folder(environment), Path(SERVICE_FOLDER)]
    return [path for folder in dict.fromkeys(folders) for path in folder.glob(f"urbi-{port}.socket")]


def _temporary_folder() -> str:
    import tempfile

    return tempfile.gettempdir()


def _bad(text: str) -> BadConfig:
    from urbihw.kernel.uobject import BadConfig

    return BadConfig(text)
