"""What appears above the prompt, which stays as it is.

prompt_toolkit's own ``run_in_terminal`` hands the terminal back to the shell's settings while it prints; keys pressed
in that moment are echoed, end a line where none should end, or kill the program.  A robot may speak fifty times a
second, so the prompt here is wiped, the text written, and the prompt drawn again below it, without touching the
settings.
"""

from __future__ import annotations

import asyncio
from typing import Any, Final

from prompt_toolkit.application import Application
from prompt_toolkit.formatted_text import AnyFormattedText, merge_formatted_text
from prompt_toolkit.renderer import print_formatted_text
from prompt_toolkit.styles.base import BaseStyle

GATHER: Final = 0.02
"""Seconds in which text is gathered, so that the prompt is drawn anew for all of it at once."""


class Above:
    """Prints above the prompt of an application."""

    def __init__(self, app: Application[Any], style: BaseStyle) -> None:
        self._app = app
        self._style = style
        self._pieces: list[AnyFormattedText] = []
        self._timer: asyncio.TimerHandle | None = None

    def show(self, piece: AnyFormattedText) -> None:
        """Print whole lines, soon and in order."""
        self._pieces.append(piece)
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(GATHER, self.flush)

    def flush(self) -> None:
        """Print now."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        pieces, self._pieces = self._pieces, []
        if not pieces:
            return
        if self._app.is_running:
            self._app.renderer.erase()
        print_formatted_text(self._app.output, merge_formatted_text(pieces), self._style)
        if self._app.is_running:
            self._app.renderer.request_absolute_cursor_position()
            self._app.invalidate()
