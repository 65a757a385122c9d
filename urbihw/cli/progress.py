"""A progress bar in one line of a terminal; nothing if standard error is not a terminal."""

from __future__ import annotations

import sys
from typing import Final, TextIO

_WIDTH: Final = 30


class ProgressBar:
    """The bar; as a context manager it is removed at the end."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._shown = ""

    def show(self, part: float, what: str) -> None:
        """Show that `part` (0..1) is done, and what is being done."""
        if not self._stream.isatty():
            return
        full = round(part * _WIDTH)
        text = f"[{'#' * full}{'.' * (_WIDTH - full)}] {what}"
        if text != self._shown:
            self._stream.write(f"\r\x1b[K{text}")
            self._stream.flush()
            self._shown = text

    def clear(self) -> None:
        """Remove the bar, so that other lines can be printed."""
        if self._shown:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
            self._shown = ""

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(self, *_: object) -> None:
        self.clear()
