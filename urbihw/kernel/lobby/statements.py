"""Statements that a lobby does not get from its client's text: frames of a remote in binary mode."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.backtrace import current_stack
from urbihw.kernel.syntax.reader import Statement, SyntaxProblem

if TYPE_CHECKING:
    from urbihw.kernel.lobby.lobby import Lobby


def execute(lobby: Lobby, text: str) -> None:
    """Run the first top-level statement of a text in the running job, as if typed: its value is printed, and with ``,``
    it runs in the background.  Further text is ignored.  Raises the errors of the statement; reports syntax errors.
    """
    for item in lobby.programs.parse(text):
        if isinstance(item, SyntaxProblem):
            kind, channel = ("", "warning") if item.warning else ("syntax error: ", "error")
            lobby.output.line(f"!!! {item.location}: {kind}{item.message}", channel)
            lobby.output.line(_caller(), channel)
            if item.warning:
                continue
            return
        assert isinstance(item, Statement)
        function = partial(lobby.programs.function(item), lobby)
        if item.separator != ",":
            lobby.shell.show(function())
            return
        scheduler = lobby.world.scheduler
        body = partial(_background, lobby, function, _caller())
        scheduler.start_now(scheduler.spawn(body, lobby.shell.next_name(), parent=scheduler.running()))
        return


def _background(lobby: Lobby, function: Callable[[], Any], caller: str) -> None:
    try:
        function()
    except Exception as error:
        lobby.report(error)
        lobby.output.line(caller, "error")


def _caller() -> str:
    """The line of an error message that names the origin of the statement."""
    stack = current_stack()
    return f"!!!    called from: {stack.location}: {stack.routine}"
