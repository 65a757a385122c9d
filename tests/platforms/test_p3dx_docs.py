"""What the README shows of the Pioneer, played against the robot in software in simulated time."""

from __future__ import annotations

import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from doc_sessions import blocks, differences
from p3dx_lab import Lab

from fakes.console import Console
from fakes.p3dx.console import commands
from urbihw.kernel.lobby.lobby import Lobby

ROOT = Path(__file__).resolve().parents[2]
PAGES = [page for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "urbihw").rglob("*.md")]
         if any(block.world == "p3dx" for block in blocks(page))]
HANDS = 2.0
"""Seconds until the person types on."""


class Windows:
    """Some connections to one lab, and the console of its fake."""

    def __init__(self) -> None:
        self.lab = Lab.ready()
        self._lobbies: dict[str, Lobby] = {}
        clock, end, laser = self.lab.bus_clock.now, self.lab.robot_line.end, self.lab.laser_line.end
        cable: Any = SimpleNamespace(device=self.lab.kit.robot, clock=clock, unplug=end.unplug, plug=end.replug)
        laser_cable = SimpleNamespace(unplug=laser.unplug, plug=laser.replug)
        self._console = Console(cable, commands(self.lab.kit, clock, laser_cable))

    def play(self, window: str, text: str) -> bytes:
        """Type a text into a window and wait until its last statement is over; what the window then shows."""
        if window not in self._lobbies:
            self._lobbies[window] = self.lab.kernel.open_lobby()
        lobby = self._lobbies[window]
        idle: list[bool] = []
        self.lab.kernel.feed(lobby, text.encode("latin-1"))
        lobby.shell.when_idle(lambda: idle.append(True))
        self.lab.run(0)
        self.lab.until(lambda: self._thought() and bool(idle), patience=120)
        return lobby.output.take()

    def happen(self, words: str) -> None:
        """Do something to the robot."""
        assert self._console.line(words) == "ok"
        self.lab.run(HANDS)

    def _thought(self) -> bool:
        """Threads know nothing of simulated time: wait for those of the planner."""
        for thread in threading.enumerate():
            if thread.name == "planner":
                thread.join(20)
        return True


def test_the_readme_is_among_them() -> None:
    assert ROOT / "urbihw" / "platforms" / "p3dx" / "README.md" in PAGES


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_answers_are_those_given(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    windows = Windows()
    assert differences(page, "p3dx", windows.play, windows.happen, stamps=False) == ""
