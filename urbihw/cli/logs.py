"""The log of the programs: the lines of all, and the ``GD_*`` variables (manual, section Environment Variables).

The variables for colours are ignored: the log has no colours.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Mapping
from types import TracebackType
from typing import Final

from urbihw.settings import escape_unprintable

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


class LineFormatter(logging.Formatter):
    """Writes each record as one line, whatever a robot, a file or a client has put into its text.

    This is the last gate before a terminal: a name with a line end would be a second line of the log, and one with an
    escape sequence a command to the terminal of its reader.
    """

    def formatMessage(self, record: logging.LogRecord) -> str:
        """The line of a record."""
        return escape_unprintable(super().formatMessage(record))

    def formatException(
        self, ei: tuple[type[BaseException], BaseException, TracebackType | None] | tuple[None, None, None]
    ) -> str:
        """The traceback of an error of ours, which keeps its lines."""
        return "\n".join(map(escape_unprintable, super().formatException(ei).split("\n")))


def make_handler(program: str, fields: str = "") -> logging.Handler:
    """Write to standard error: the fields of a record, the name of the program, the message."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(LineFormatter(f"{fields}{program}: %(message)s"))
    return handler


def set_up(program: str, verbosity: str | None, environment: Mapping[str, str]) -> None:
    """Log to standard error.  ``verbosity`` (``--debug``) wins over ``GD_LEVEL``; an unknown ``GD_LEVEL`` is LOG."""
    wanted = verbosity or environment.get("GD_LEVEL", "LOG").upper()
    handler = make_handler(program, "".join(text for name, text in _FIELDS if name in environment))
    handler.addFilter(_Categories(environment.get("GD_ENABLE_CATEGORY"), environment.get("GD_DISABLE_CATEGORY")))
    logging.basicConfig(handlers=[handler], level=LEVELS.get(wanted, logging.WARNING), force=True)
