"""One statement handed to a lobby by something else than its client's typing: a frame of a remote in binary mode."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from urbihw.kernel.runtime.backtrace import current_stack
from urbihw.kernel.syntax.reader import Statement, SyntaxProblem, parse_program

if TYPE_CHECKING:
    from urbihw.kernel.lobby.lobby import Lobby


def execute(lobby: Lobby, text: str) -> None:
    """Run the first top-level statement of a text in the running job, as if typed: its value is printed, with ``,`` it
    runs in the background.  Whatever follows it is left out.  Errors are raised, those of syntax are told.
    """
    for item in parse_program(text):
        if isinstance(item, SyntaxProblem):
            kind, channel = ("", "warning") if item.warning else ("syntax error: ", "error")
            lobby.output.line(f"!!! {item.location}: {kind}{item.message}", channel)
            stack = current_stack()
            lobby.output.line(f"!!!    called from: {stack.location}: {stack.routine}", channel)
            if item.warning:
                continue
            return
        assert isinstance(item, Statement)
        function = partial(lobby.programs.function(item), lobby)
        if item.separator != ",":
            lobby.shell.show(function())
            return
        scheduler = lobby.world.scheduler
        scheduler.start_now(scheduler.spawn(function, lobby.shell.next_name(), parent=scheduler.running()))
        return
