"""Rows of text that are written over each other on a terminal."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from typing import TextIO


class RowsInPlace:
    """A block of rows, shown again and again in the same place.

    A row is cut where the terminal ends, and rows for which it has no room are counted in the last one: a row that
    wraps, or scrolls the screen, would be written over another one.
    """

    def __init__(self) -> None:
        self._count = 0

    def show(self, stream: TextIO, rows: Sequence[str]) -> None:
        """Show these rows in the place of the last ones, and nothing below them."""
        columns, lines = shutil.get_terminal_size()
        room = max(lines - 1, 1)
        if len(rows) > room:
            rows = [*rows[: room - 1], f"... and {len(rows) - room + 1} more; the terminal has {lines} lines"]
        up = f"\x1b[{self._count}A" if self._count else ""
        stream.write(up + "".join(f"\r\x1b[K{row[: columns - 1]}\n" for row in rows) + "\x1b[J")
        stream.flush()
        self._count = len(rows)

    def skip_line(self) -> None:
        """The user has pressed Enter below the rows: the cursor is one line further down."""
        self._count += 1 if self._count else 0

    def leave(self) -> None:
        """The next rows come below these."""
        self._count = 0
