"""Removes the sockets that a killed daemon has left in the runtime folder.

A socket is dead if no process listens at it and none has bound it: a daemon binds its sockets early, and listens when
the robot is found.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import socket
import stat
from pathlib import Path
from typing import Final

PATTERNS: Final = ("*.sock", "urbi-*.socket", "*.feed", "*.recording", "*.flight")
"""The names of control sockets, of sockets for clients, and of those for and of recorders."""
BOUND_SOCKETS: Final = Path("/proc/net/unix")
"""The bound UNIX sockets of the system; the last of eight fields is the path."""

log = logging.getLogger("urbihw.daemon")


def remove_dead_sockets(folder: Path) -> None:
    """Remove the dead sockets of this user.  Where the system does not list bound sockets, none is removed."""
    refused = [(path, found) for path in _sockets(folder) if (found := _refusing_file(path)) is not None]
    if not refused:
        return
    bound = _bound_paths()
    if bound is None:
        return
    for path, found in refused:
        # A daemon that has started since has replaced the file.
        if str(path) not in bound and _identity(path) == found:
            with contextlib.suppress(OSError):
                path.unlink()
                log.debug("removed %s, which a killed daemon has left", path)


def _sockets(folder: Path) -> list[Path]:
    return [path for pattern in PATTERNS for path in sorted(folder.glob(pattern))]


def _refusing_file(path: Path) -> tuple[int, int, int] | None:
    """The identity of a socket of this user at which no process listens; None for any other file."""
    found = _identity(path)
    if found is None:
        return None
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.setblocking(False)
        try:
            refused = probe.connect_ex(str(path)) == errno.ECONNREFUSED
        except OSError:  # a path that is too long
            return None
    return found if refused else None


def _identity(path: Path) -> tuple[int, int, int] | None:
    """Device, inode and time of creation of a socket of this user."""
    try:
        about = path.lstat()
    except OSError:
        return None
    if not stat.S_ISSOCK(about.st_mode) or about.st_uid != os.geteuid():
        return None
    return about.st_dev, about.st_ino, about.st_ctime_ns


def _bound_paths() -> set[str] | None:
    """The paths of all bound sockets; None if the system does not list them."""
    try:
        rows = BOUND_SOCKETS.read_text(errors="surrogateescape").splitlines()[1:]
    except OSError:
        return None
    return {fields[7] for row in rows if len(fields := row.split(maxsplit=7)) == 8}
