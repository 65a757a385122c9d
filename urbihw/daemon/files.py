"""Reads files named by a user: settings, tokens, certificates, programs to load.

The thread that serves all clients reads them, so reading must not block: a FIFO or a device is refused before it is
opened, and a file that is too long is not read to its end.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import NamedTuple

from urbihw.kernel.uobject import BadConfig


class Content(NamedTuple):
    """The content of a file, and its mode (``st_mode``) at the same moment."""

    data: bytes
    mode: int


def read_regular(file: Path, longest: int) -> Content:
    """Read a regular file of at most ``longest`` bytes.

    Raises BadConfig, in one line that names the file, if it cannot be read, is something else than a regular file, or
    is longer; FileNotFoundError if there is none.
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
        raise unreadable(file, error) from error
    if len(data) > longest:
        raise BadConfig(f"{file}: is longer than {longest} bytes: this is the wrong file")
    return Content(data, mode)


def unreadable(file: Path, error: OSError) -> BadConfig:
    """The error for a file that cannot be read."""
    return BadConfig(f"{file}: cannot be read: {error.strerror}")


def _require_regular(file: Path, mode: int) -> None:
    if not stat.S_ISREG(mode):
        raise BadConfig(f"{file}: is not a regular file: name one that is")
