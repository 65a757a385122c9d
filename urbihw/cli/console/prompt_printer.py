"""Prints text above the prompt, which stays unchanged.

prompt_toolkit's own ``run_in_terminal`` restores the shell's terminal settings while it prints; keys pressed in that
moment are echoed, end a line unexpectedly, or kill the program.  A robot may write fifty times a second, so here the
prompt is erased, the text is written, and the prompt is drawn again below it, with the same terminal settings.
"""

from __future__ import annotations

import asyncio
from typing import Any, Final

from prompt_toolkit.application import Application
from prompt_toolkit.formatted_text import AnyFormattedText, merge_formatted_text
from prompt_toolkit.renderer import print_formatted_text
from prompt_toolkit.styles.base import BaseStyle

FLUSH_DELAY_S: Final = 0.02
"""Seconds during which text is collected, so that the prompt is redrawn once for all of it."""


class PromptPrinter:
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
            self._timer = asyncio.get_running_loop().call_later(FLUSH_DELAY_S, self.flush)

    def flush(self) -> None:
        """Print the collected text now."""
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
