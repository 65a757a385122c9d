"""Reads and writes files named by a user: settings, tokens, programs to load, maps.

The thread that serves all clients does so, and a file may be anything: to read must not block, or end never.  A FIFO or
a device is refused before it is opened, and a file that is too long is not read to its end.
"""

from __future__ import annotations

import os
import secrets
import stat
from pathlib import Path
from typing import NamedTuple


class BadFile(ValueError):
    """A file that cannot be read or written; the message is one line that names it."""


class Content(NamedTuple):
    """The content of a file, and its mode (``st_mode``) at the same moment."""

    data: bytes
    mode: int


def read_regular(file: Path, longest: int) -> Content:
    """Read a regular file of at most ``longest`` bytes.

    Raises BadFile if it cannot be read, is something else than a regular file, or is longer; FileNotFoundError if it
    does not exist.
    """
    try:
        # To open a file can have effects: a serial port resets the board behind it, a FIFO lets its writer go on.
        _require_regular(file, file.stat().st_mode)
        # The file may have been replaced meanwhile, and to open a FIFO would wait for a writer.
        with open(os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC), "rb") as opened:
            mode = os.fstat(opened.fileno()).st_mode
            _require_regular(file, mode)
            data = opened.read(longest + 1)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise BadFile(cannot_read(file, error)) from error
    except ValueError as error:
        raise _named(file, error) from error
    if len(data) > longest:
        raise BadFile(f"{file}: is longer than {longest} bytes: this is the wrong file")
    return Content(data, mode)


def cannot_read(file: Path, error: OSError) -> str:
    """The message for a file that cannot be read."""
    return f"{file}: cannot be read: {error.strerror}"


def write_regular(file: Path, data: bytes) -> None:
    """Write a file as a whole: it has its former content until all of it is written.  A file that was there keeps its
    mode.

    Raises BadFile if it cannot be written, or something else than a regular file has this name.
    """
    made: Path | None = None
    try:
        target = file.resolve()
        mode = target.stat().st_mode if target.exists() else None
        if mode is not None:
            _require_regular(file, mode)
        made = target.with_name(f".{secrets.token_hex(8)}.new")
        with made.open("xb") as opened:
            opened.write(data)
            if mode is not None:
                os.fchmod(opened.fileno(), stat.S_IMODE(mode))
        made.replace(target)
    except OSError as error:
        if made is not None:
            made.unlink(missing_ok=True)
        raise BadFile(f"{file}: cannot be written: {error.strerror}") from error
    except ValueError as error:
        raise _named(file, error) from error


def _named(file: Path, error: ValueError) -> BadFile:
    """The error for a name with a null byte, which no file can have."""
    return error if isinstance(error, BadFile) else BadFile(f"{str(file)!r}: is no name of a file: {error}")


def _require_regular(file: Path, mode: int) -> None:
    if not stat.S_ISREG(mode):
        raise BadFile(f"{file}: is not a regular file: name one that is")
