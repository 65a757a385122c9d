"""Where the daemon keeps what outlasts it: its certificate, and the hashes of the tokens that let clients in.

Who can write there can let anybody in, so a folder that others can write is refused.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from urbihw.daemon.files import read_regular
from urbihw.kernel.uobject import BadConfig

SERVICE_STATE: Final = Path("/var/lib/urbihw")
"""StateDirectory of the unit in share/."""
LONGEST_SECRET: Final = 1024 * 1024
"""Bytes of a file of tokens, or of a key with its certificate."""


def state_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder of certificate and tokens, made if need be; it is apart from what programs may leave beside it.

    Under systemd in that of the unit (STATE_DIRECTORY); for root in that of the service if there is one, so that ``sudo
    urbihw access`` is about the service; else in ``urbihw`` of XDG_STATE_HOME.  Raises BadConfig if it cannot be made,
    or others can write there.
    """
    if environment.get("STATE_DIRECTORY"):
        above = Path(environment["STATE_DIRECTORY"].split(":")[0])
    elif os.geteuid() == 0 and SERVICE_STATE.is_dir():
        above = SERVICE_STATE
    else:
        home = environment.get("XDG_STATE_HOME") or os.path.join(environment.get("HOME", "~"), ".local", "state")
        above = Path(home).expanduser() / "urbihw"
    folder = above / "access"
    try:
        if not folder.is_dir():
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            _give(folder, above)
        about = folder.lstat()
    except OSError as error:
        raise BadConfig(f"no folder for certificate and tokens: {folder}: {error.strerror}") from error
    if not stat.S_ISDIR(about.st_mode) or about.st_mode & 0o022 or about.st_uid != os.geteuid() != 0:
        raise BadConfig(f"{folder} belongs to somebody else or can be written by others, who could let anybody in: "
                        f"chmod 700 {folder}, or move it away")
    return folder


def _give(file: Path | int, folder: Path) -> None:
    """What root makes for the service belongs to it, as the folder does that it is in."""
    if os.geteuid() == 0:
        about = folder.stat()
        os.chown(file, about.st_uid, about.st_gid)


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[None]:
    """While others who want the same wait: for what is read, changed and written again."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def read_secret(file: Path) -> str:
    """The text of a file, "" for none.  Raises BadConfig when it cannot be read, or when others can."""
    try:
        content = read_regular(file, LONGEST_SECRET)
    except FileNotFoundError:
        return ""
    if stat.S_IMODE(content.mode) & 0o077:
        raise BadConfig(f"{file}: can be read by others: chmod 600 {file}, and make anew what is in it")
    return content.data.decode("utf-8", "replace")


def write_secret(file: Path, text: str) -> None:
    """Replace a file by one that its owner alone may read: at once, so that nobody sees half of it.

    It belongs to whom the folder belongs to: root writes for the service.  Raises BadConfig.
    """
    fresh = file.with_name(f"{file.name}.{os.getpid()}")
    try:
        descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
        with open(descriptor, "w", encoding="utf-8") as opened:
            _give(descriptor, file.parent)
            opened.write(text)
            opened.flush()
            os.fsync(descriptor)
        fresh.replace(file)
    except OSError as error:
        with contextlib.suppress(OSError):
            fresh.unlink()
        raise BadConfig(f"cannot write {file}: {error.strerror}") from error
