"""Finds the process that has a port or a device open, for error messages.

Works on Linux only, and for processes that this user can inspect; otherwise the result is "".
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

PROC = Path("/proc")
_LISTEN = "0A"  # state in /proc/net/tcp
_WORKERS = {b"urbihw.buses.child", b"urbihw.buses.spare"}


def holder_of_port(port: int, proc: Path = PROC) -> str:
    """The process that listens on a TCP port, such as ``python3 (process 4242)``; "" if unknown."""
    inodes = set(_listening(port, proc))
    return _holder({f"socket:[{inode}]" for inode in inodes}, proc) if inodes else ""


def holder_of_file(path: str, proc: Path = PROC) -> str:
    """The process, other than this one, that has a file or device open; "" if unknown.

    A daemon of urbihw goes first: the other side of a pseudo terminal has it open, too.
    """
    daemon = daemon_of_file(path, proc)
    if daemon:
        return f"an urbihw daemon (process {daemon})"
    return _holder({os.path.realpath(path)}, proc)


def daemon_of_file(path: str, proc: Path = PROC) -> int:
    """The process number of the urbihw daemon whose bus worker has a device open; 0 for another process."""
    for process in _holders({os.path.realpath(path)}, proc):
        try:
            words = (process / "cmdline").read_bytes().split(b"\0")
            fields = (process / "stat").read_text("ascii", "replace").rpartition(")")[2].split()
        except OSError:
            continue
        if not _WORKERS.isdisjoint(words):
            return int(fields[1])
    return 0


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
    for process in _holders(targets, proc):
        try:
            return f"{(process / 'comm').read_text('utf-8').strip()} (process {process.name})"
        except OSError:  # It has just ended.
            continue
    return ""


def _holders(targets: set[str], proc: Path) -> Iterator[Path]:
    """The folders of the other processes that have one of these files open, in order of their numbers."""
    for process in sorted(proc.glob("[0-9]*"), key=lambda path: int(path.name)):
        if process.name == str(os.getpid()):
            continue
        try:
            if any(_target(entry) in targets for entry in (process / "fd").iterdir()):
                yield process
        except OSError:
            # A process of another user, or one that has just ended.
            continue


def _target(entry: Path) -> str:
    try:
        return os.readlink(entry)
    except OSError:
        return ""
