"""The state folder of the daemon: its certificate, the hashes of the tokens of clients, what it knows of its robots.

A user who can write there can give access to anyone, so a folder that other users can write is refused.
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
"""The StateDirectory of the unit in urbihw/share."""
MAX_SECRET_BYTES: Final = 1024 * 1024
"""Maximum size in bytes of a file of tokens, or of a key with its certificate."""


def state_folder(environment: Mapping[str, str] = os.environ, *, create: bool = True) -> Path:
    """The folder of certificate and tokens; files of programs are outside of it.  With ``create`` it is created if
    needed.

    Under systemd it is in that of the unit (STATE_DIRECTORY); for root in that of the service if there is one, so that
    ``sudo urbihw access`` applies to the service; otherwise in ``urbihw`` of XDG_STATE_HOME.  Raises BadConfig if it
    cannot be created, or if other users can write there.
    """
    above = _base_folder(environment)
    folder = above / "access"
    try:
        if not folder.is_dir():
            if not create and not os.path.lexists(folder):
                return folder
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            _give_to_owner(folder, above)
        about = folder.lstat()
    except OSError as error:
        raise BadConfig(f"no folder for certificate and tokens: {folder}: {error.strerror}") from error
    if not stat.S_ISDIR(about.st_mode) or about.st_mode & 0o022 or about.st_uid != os.geteuid() != 0:
        raise BadConfig(f"{folder} belongs to somebody else or can be written by others, who could let anybody in: "
                        f"chmod 700 {folder}, or move it away")
    return folder


def robots_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder of what the last run knew of its robots (``urbihw.platforms.remembered``); it may not exist yet."""
    return _base_folder(environment) / "robots"


def motions_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder of the motions and poses of all robots, with a folder for each platform; it may not exist yet."""
    return _base_folder(environment) / "motions"


def recordings_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder of the recordings of all robots, with a folder for each platform; it may not exist yet."""
    return _base_folder(environment) / "recordings"


def _base_folder(environment: Mapping[str, str]) -> Path:
    if environment.get("STATE_DIRECTORY"):
        return Path(environment["STATE_DIRECTORY"].split(":")[0])
    if os.geteuid() == 0 and SERVICE_STATE.is_dir():
        return SERVICE_STATE
    home = environment.get("XDG_STATE_HOME") or os.path.join(environment.get("HOME", "~"), ".local", "state")
    return Path(home).expanduser() / "urbihw"


def credential(name: str, environment: Mapping[str, str] = os.environ) -> Path | None:
    """The file of a credential that the service manager has passed (``LoadCredential``); None if there is none.

    Only the service can read it, whatever its mode shows: systemd gives the right by an access control list.
    """
    folder = environment.get("CREDENTIALS_DIRECTORY")
    file = Path(folder, name) if folder else None
    return file if file is not None and file.exists() else None


def _give_to_owner(file: Path | int, folder: Path) -> None:
    """Give a file created by root to the owner of its folder, which is the user of the service."""
    if os.geteuid() == 0:
        about = folder.stat()
        os.chown(file, about.st_uid, about.st_gid)


@contextlib.contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Hold an exclusive lock on the folder, for files that are read, changed and written again; a folder that does not
    exist needs none."""
    if not folder.exists():
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def read_secret(file: Path) -> str:
    """The text of a file, "" if there is none.  Raises BadConfig if it cannot be read, or if other users can read
    it."""
    try:
        content = read_regular(file, MAX_SECRET_BYTES)
    except FileNotFoundError:
        return ""
    if stat.S_IMODE(content.mode) & 0o077:
        raise BadConfig(f"{file}: can be read by others: chmod 600 {file}, and make anew what is in it")
    return content.data.decode("utf-8", "replace")


def write_secret(file: Path, text: str) -> None:
    """Replace a file atomically by one that only its owner can read.

    It gets the owner of the folder: root writes for the service.  Raises BadConfig.
    """
    fresh = file.with_name(f"{file.name}.{os.getpid()}")
    try:
        descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
        with open(descriptor, "w", encoding="utf-8") as opened:
            _give_to_owner(descriptor, file.parent)
            opened.write(text)
            opened.flush()
            os.fsync(descriptor)
        fresh.replace(file)
    except OSError as error:
        with contextlib.suppress(OSError):
            fresh.unlink()
        raise BadConfig(f"cannot write {file}: {error.strerror}") from error
