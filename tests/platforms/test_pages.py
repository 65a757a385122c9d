"""What README and docs show of the robots, played against the simulated robots in simulated time."""

from __future__ import annotations

import importlib
import shutil
from pathlib import Path

import pytest
from doc_sessions import WORLDS, blocks, differences, differences_again
from lab import RobotLab

from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.uobject.protection import protect_robot
from urbihw.platforms import find

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = [world for world in WORLDS if world not in ("", "servo")]
FOLDERS = (ROOT / "docs", ROOT / "urbihw", ROOT / "packages")
PAGES = [ROOT / "README.md", *(page for folder in FOLDERS for page in sorted(folder.rglob("*.md")))]
PLAYED = [(robot, page) for page in PAGES for robot in ROBOTS if any(block.world == robot for block in blocks(page))]

HANDS = 2.0
"""Seconds until the person types on."""


class Windows:
    """Some connections to one lab, and the console of its fake."""

    def __init__(self, robot: str) -> None:
        self.lab: RobotLab = importlib.import_module(f"{robot}_lab").Lab.ready()
        # As in the daemon.
        protect_robot(self.lab.robot, find(robot).slot)
        self.lab.kernel.complete()
        self._console = self.lab.console()
        self._lobbies: dict[str, Lobby] = {}

    def play(self, window: str, text: str) -> bytes:
        """Type a text into a window and wait until its last statement is over; what the window then shows."""
        if window not in self._lobbies:
            self._lobbies[window] = self.lab.kernel.open_lobby()
        lobby = self._lobbies[window]
        idle: list[bool] = []
        self.lab.kernel.feed(lobby, text.encode("latin-1"))
        lobby.shell.when_idle(lambda: idle.append(True))
        self.lab.run(0)
        self.lab.until(lambda: self.lab.thought() and bool(idle), patience=120)
        return lobby.output.take_bytes()

    def leave(self) -> None:
        """Close all connections."""
        while self._lobbies:
            self._lobbies.popitem()[1].close()
        self.lab.run(HANDS)

    def happen(self, words: str) -> None:
        """Do something to the robot; a person takes some time from one window to the other."""
        assert self._console.line(words) == "ok"
        self.lab.run(HANDS)


def test_the_main_page_and_each_robots_own_are_among_them() -> None:
    assert ROOT / "README.md" in [page for _, page in PLAYED]
    assert {(robot, find(robot).folder / "README.md") for robot in ROBOTS} <= set(PLAYED)


@pytest.mark.parametrize(("robot", "page"), PLAYED, ids=[f"{robot}: {page.parent.name}" for robot, page in PLAYED])
def test_answers_are_those_given(robot: str, page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(RobotLab, "motions", str(tmp_path))
    shutil.copy(ROOT / "docs" / "examples" / "bow.mtn", tmp_path)
    windows = Windows(robot)
    assert differences(page, robot, windows.play, windows.happen, stamps=False) == ""
    windows.leave()
    assert differences_again(page, robot, windows.play, windows.happen) == ""
