"""Reads files that the settings name (``urbihw.files``); their faults are those of the settings."""

from __future__ import annotations

from pathlib import Path

from urbihw import files
from urbihw.files import BadFile, Content
from urbihw.kernel.uobject import BadConfig


def read_regular(file: Path, longest: int) -> Content:
    """As ``urbihw.files.read_regular``, but raises BadConfig for a file that cannot be used."""
    try:
        return files.read_regular(file, longest)
    except BadFile as error:
        raise BadConfig(str(error)) from error


def unreadable(file: Path, error: OSError) -> BadConfig:
    """The error for a file that cannot be read."""
    return BadConfig(files.cannot_read(file, error))
