"""Finds the process that has a port or a device open, for error messages.

Works on Linux only, and for processes that this user can inspect; otherwise the result is "".
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

PROC = Path("/proc")
_LISTEN = "0A"  # state in /proc/net/tcp


def holder_of_port(port: int, proc: Path = PROC) -> str:
    """The process that listens on a TCP port, such as ``python3 (process 4242)``; "" if unknown."""
    inodes = set(_listening(port, proc))
    return _holder({f"socket:[{inode}]" for inode in inodes}, proc) if inodes else ""


def holder_of_file(path: str, proc: Path = PROC) -> str:
    """The process, other than this one, that has a file or device open; "" if unknown."""
    return _holder({os.path.realpath(path)}, proc)


def _listening(port: int, proc: Path) -> Iterator[str]:
    for name in ("tcp", "tcp6"):
        try:
            lines = (proc / "net" / name).read_text("ascii").splitlines()[1:]
        except OSError:
            continue
        for line in lines:
            fields = line.split()
            if len(fields) > 9 and fields[3] == _LISTEN and int(fields[1].rpartition(":")[2], 16) == port:
                yield fields[9]


def _holder(targets: set[str], proc: Path) -> str:
    for process in sorted(proc.glob("[0-9]*"), key=lambda path: int(path.name)):
        if process.name == str(os.getpid()):
            continue
        try:
            if any(_target(entry) in targets for entry in (process / "fd").iterdir()):
                return f"{(process / 'comm').read_text('utf-8').strip()} (process {process.name})"
        except OSError:
            # A process of another user, or one that has just ended.
            continue
    return ""


def _target(entry: Path) -> str:
    try:
        return os.readlink(entry)
    except OSError:
        return ""
