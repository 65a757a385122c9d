"""The log of the programs, configured by the ``GD_*`` variables (manual, section Environment Variables).

The variables for colours are ignored: the log has no colours.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Mapping
from typing import Final

LEVELS: Final = {
    "NONE": logging.CRITICAL + 10,
    "LOG": logging.WARNING,
    "TRACE": logging.INFO,
    "DEBUG": logging.DEBUG,
    "DUMP": logging.DEBUG,
}
"""The levels, in the order of verbosity."""

_FIELDS: Final = (
    ("GD_TIME", "%(asctime)s "),
    ("GD_TIMESTAMP_US", "%(created)f "),
    ("GD_PID", "[%(process)d] "),
    ("GD_THREAD", "<%(threadName)s> "),
    ("GD_LOC", "%(pathname)s:%(lineno)d: %(funcName)s: "),
)


def level(text: str) -> str:
    """Parse the name of a level, in upper or lower case."""
    if text.upper() not in LEVELS:
        raise argparse.ArgumentTypeError(f"{text!r} is no level; there are: {', '.join(LEVELS)}")
    return text.upper()


class _Categories(logging.Filter):
    """Passes records of the given loggers only, or of all others, by the last part of their name or the whole name."""

    def __init__(self, only: str | None, never: str | None) -> None:
        super().__init__()
        self._only = None if only is None else set(only.split(","))
        self._never = set((never or "").split(","))

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether to show a record."""
        names = {record.name, record.name.rpartition(".")[2]}
        return not names & self._never and (self._only is None or bool(names & self._only))


def set_up(program: str, verbosity: str | None, environment: Mapping[str, str]) -> None:
    """Log to standard error.  ``verbosity`` (``--debug``) wins over ``GD_LEVEL``; an unknown ``GD_LEVEL`` is LOG."""
    wanted = verbosity or environment.get("GD_LEVEL", "LOG").upper()
    handler = logging.StreamHandler(sys.stderr)
    fields = "".join(text for name, text in _FIELDS if name in environment)
    handler.setFormatter(logging.Formatter(f"{fields}{program}: %(message)s"))
    handler.addFilter(_Categories(environment.get("GD_ENABLE_CATEGORY"), environment.get("GD_DISABLE_CATEGORY")))
    logging.basicConfig(handlers=[handler], level=LEVELS.get(wanted, logging.WARNING), force=True)
