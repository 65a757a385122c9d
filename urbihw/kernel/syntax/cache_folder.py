"""Files kept from one start to the next: the tables of the grammar, and compiled code.

They are in ``$XDG_CACHE_HOME/urbihw`` or ``~/.cache/urbihw``.  Compiled code from there is run, so a folder or a file
that a user other than root could have written is not read.  A file begins with the SHA-256 digest of its content: one
that was damaged, by a power cut for example, is not read, since damaged code would crash the interpreter.  Where the
folder cannot be used, everything works, only slower.  The name of a file is a hash of everything that it depends on, so
a file never becomes invalid; the least recently used files are removed when there are too many.
"""

from __future__ import annotations

import contextlib
import logging
import os
import stat
from collections.abc import Iterator
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Final

log = logging.getLogger("urbihw.kernel")

MAX_FILES: Final = 400
"""Maximum number of files; the library has about thirty for each release of urbihw and of Python."""

MAX_FILE_SIZE: Final = 64 * 1024 * 1024
"""Bytes; a larger file is not read.  The largest that we write have some megabytes."""
OPEN_FLAGS: Final = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
DIGEST_SIZE: Final = sha256().digest_size


def cache_folder() -> Path:
    """The path of the folder (XDG base directories); it need not exist."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "urbihw"


def read_cached(name: str) -> bytes | None:
    """The content of a file; None if there is no trusted and undamaged one."""
    try:
        with _open_folder(cache_folder()) as folder:
            descriptor = os.open(name, OPEN_FLAGS, dir_fd=folder)
            with open(descriptor, "rb") as file:
                status = os.fstat(descriptor)
                if not stat.S_ISREG(status.st_mode) or status.st_size > MAX_FILE_SIZE:
                    return None
                if not _is_trusted(status, cache_folder() / name):
                    return None
                with contextlib.suppress(OSError):  # on a read-only file system
                    os.utime(descriptor)
                digest, content = file.read(DIGEST_SIZE), file.read()
    except OSError:
        return None
    return content if sha256(content).digest() == digest else None


def write_cached(name: str, content: bytes) -> None:
    """Write a file to the cache; a failure is ignored.

    Another process may be writing the same file: it appears whole or not at all.
    """
    scratch = f"{name}.{os.getpid()}.tmp"
    with contextlib.suppress(OSError):
        path = cache_folder()
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        if path.stat().st_uid == os.geteuid():
            path.chmod(0o700)
        with _open_folder(path) as folder:
            descriptor = os.open(scratch, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600, dir_fd=folder)
            try:
                with open(descriptor, "wb") as file:
                    file.write(sha256(content).digest() + content)
                os.replace(scratch, name, src_dir_fd=folder, dst_dir_fd=folder)
            except OSError:
                os.unlink(scratch, dir_fd=folder)
                raise
            _remove_oldest(folder)


@contextlib.contextmanager
def _open_folder(path: Path) -> Iterator[int]:
    """Open the folder as a descriptor, which stays the checked folder even if its path is replaced.

    Raises OSError, also if the folder is not trusted.
    """
    folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        if not _is_trusted(os.fstat(folder), path):
            raise PermissionError(path)
        yield folder
    finally:
        os.close(folder)


def _is_trusted(status: os.stat_result, path: Path) -> bool:
    """Whether only this user and root can have written the file or folder."""
    trusted = status.st_uid in (0, os.geteuid()) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    if not trusted:
        _warn(path)
    return trusted


@lru_cache
def _warn(path: Path) -> None:
    log.warning("%s is not used, since others could have written it: remove it", path)


def _remove_oldest(folder: int) -> None:
    """Remove a quarter of the files if there are too many."""
    names = os.listdir(folder)
    if len(names) <= MAX_FILES:
        return
    written = []
    for name in names:
        with contextlib.suppress(OSError):  # removed by another process
            written.append((os.stat(name, dir_fd=folder, follow_symlinks=False).st_mtime, name))
    for _, name in sorted(written)[: len(names) // 4]:
        with contextlib.suppress(OSError):
            os.unlink(name, dir_fd=folder)
