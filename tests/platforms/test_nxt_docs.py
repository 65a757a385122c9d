"""What the README shows of the NXT, played against the TriBot in software in simulated time."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from doc_sessions import blocks, differences
from nxt_lab import Lab

from fakes.console import Console
from fakes.nxt.console import commands
from urbihw.kernel.lobby.lobby import Lobby

ROOT = Path(__file__).resolve().parents[2]
PAGES = [page for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "urbihw").rglob("*.md")]
         if any(block.world == "nxt" for block in blocks(page))]
HANDS = 2.0
"""Seconds until the person types on."""


class Windows:
    """Some connections to one lab, and the console of its fake."""

    def __init__(self) -> None:
        self.lab = Lab.ready()
        self._lobbies: dict[str, Lobby] = {}
        end, clock = self.lab.end, self.lab.bus_clock.now
        cable: Any = SimpleNamespace(device=self.lab.device, clock=clock, unplug=self.lab.unplug, plug=end.replug)
        self._console = Console(cable, commands(self.lab.device, clock))

    def play(self, window: str, text: str) -> bytes:
        """Type a text into a window and wait until its last statement is over; what the window then shows."""
        if window not in self._lobbies:
            self._lobbies[window] = self.lab.kernel.open_lobby()
        lobby = self._lobbies[window]
        idle: list[bool] = []
        self.lab.kernel.feed(lobby, text.encode("latin-1"))
        lobby.shell.when_idle(lambda: idle.append(True))
        self.lab.run(0)
        self.lab.until(lambda: bool(idle), patience=60)
        return lobby.output.take()

    def happen(self, words: str) -> None:
        """Do something to the robot."""
        assert self._console.line(words) == "ok"
        self.lab.run(HANDS)


def test_the_readme_is_among_them() -> None:
    assert ROOT / "urbihw" / "platforms" / "nxt" / "README.md" in PAGES


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_answers_are_those_given(page: Path) -> None:
    windows = Windows()
    assert differences(page, "nxt", windows.play, windows.happen, stamps=False) == ""
