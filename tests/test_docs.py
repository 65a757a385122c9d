"""The documents against what they speak of: dependencies, adapters, links, paths, and the dialogues that they show.

Dialogues with a Bioloid are played in ``tests/platforms/test_pages.py``.
"""

from __future__ import annotations

import importlib
import json
import re
import tomllib
from pathlib import Path

import pytest
from doc_sessions import blocks, differences, differences_again
from lang.transcript import Player

from urbihw.kernel.lobby.lobby import Lobby

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted(
    [*ROOT.glob("*.md"), *(page for folder in ("docs", "urbihw", "packages") for page in (ROOT / folder).rglob("*.md"))]
)

_NAME = re.compile(r"[A-Za-z0-9_-]+")
_LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
_PATH = re.compile(r"`((?:urbihw|fakes|packages|tests|docs|bench|share)/[\w./-]+)`")
_KINDS = ("added", "changed", "fixed", "removed")


def requirements() -> dict[str, str]:
    """Every package that a pyproject.toml names, with its range."""
    found = {}
    for file in (ROOT / "pyproject.toml", *ROOT.glob("packages/*/pyproject.toml")):
        whole = tomllib.loads(file.read_text())
        project = whole["project"]
        extras = [row for extra in project["optional-dependencies"].values() for row in extra]
        for row in (*whole["build-system"]["requires"], *project["dependencies"], *extras):
            name = _NAME.match(row)
            assert name is not None, row
            if name[0] != "urbihw":  # an extra made of other extras, or a wheel beside urbihw
                found[name[0]] = row[name.end() :]
    return found


def test_every_dependency_has_its_row_with_range_and_reason() -> None:
    page = (ROOT / "docs" / "dependencies.md").read_text()
    tables = [part.splitlines() for part in page.split("\n\n") if part.startswith("| package |")]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for table in tables for line in table[2:]]
    assert {row[0]: row[1] for row in rows if row[2]} == requirements()


def test_every_dependency_is_bounded_above_but_those_of_the_build() -> None:
    assert [name for name, bounds in requirements().items() if "<" not in bounds] == ["setuptools", "setuptools-scm"]


def leads_nowhere(page: Path) -> list[str]:
    """The links and paths of a page that name no file."""
    text = page.read_text()
    links = [link for link in _LINK.findall(text) if "://" not in link]
    gone = [link for link in links if not (page.parent / link).exists()]
    gone += [path for path in _PATH.findall(text) if not (ROOT / path).exists()]
    return [f"{page.relative_to(ROOT)}: {name}" for name in gone]


def test_links_and_paths_lead_somewhere() -> None:
    assert [name for page in PAGES for name in leads_nowhere(page)] == []


def test_the_udev_rules_name_the_adapters_of_the_manifests() -> None:
    wanted = set()
    for manifest in (ROOT / "urbihw" / "platforms").glob("*/platform.toml"):
        for usb in tomllib.loads(manifest.read_text()).get("usb", []):
            wanted.add((f"{usb['vendor']:04x}", f"{usb['product']:04x}", f"urbihw-{manifest.parent.name}"))
    rules = (ROOT / "urbihw" / "share" / "99-urbihw.rules").read_text()
    row = re.compile(r'^ATTRS\{idVendor\}=="(\w+)", ATTRS\{idProduct\}=="(\w+)", SYMLINK\+="([\w-]+)"', re.MULTILINE)
    assert wanted
    assert set(row.findall(rules)) == wanted


def test_the_picture_of_the_main_page_is_what_was_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs" / "pictures")
    make = importlib.import_module("make")
    assert make.draw(json.loads(make.SESSION.read_text())) == make.PICTURE.read_text()


def test_news_are_fragments_of_a_known_kind() -> None:
    names = {path.name for path in (ROOT / "docs" / "news").iterdir()} - {"README.md"}
    assert [name for name in names if name.split(".")[1:] not in [[kind, "md"] for kind in _KINDS]] == []


# ---------------------------------------------------------------- dialogues


class Windows:
    """Some connections to one kernel on a simulated clock."""

    def __init__(self) -> None:
        self.player = Player()
        self._lobbies: dict[str, Lobby] = {}

    def play(self, window: str, text: str) -> bytes:
        """Type a text into a window and wait until its last statement is over; what the window then shows."""
        if window not in self._lobbies:
            self._lobbies[window] = self.player.kernel.open_lobby()
        lobby = self._lobbies[window]
        assert self.player.run(lobby, text) == ""
        return lobby.output.take_bytes()

    def leave(self) -> None:
        """Close all connections."""
        while self._lobbies:
            self._lobbies.popitem()[1].close()

    def play_twice(self, page: Path, world: str) -> str:
        """Play a page, and again by new connections; what differed, or nothing."""
        found = differences(page, world, self.play, no_robot, stamps=True)
        self.leave()
        return found or differences_again(page, world, self.play, no_robot)


def no_robot(words: str) -> None:
    """A page without a robot cannot do anything to one."""
    raise AssertionError(f"there is no robot here to {words}")


def pages_with(world: str) -> list[Path]:
    return [page for page in PAGES if any(block.world == world for block in blocks(page))]


def test_there_are_dialogues_to_play() -> None:
    assert ROOT / "docs" / "urbiscript.md" in pages_with("")
    assert ROOT / "docs" / "uobject.md" in pages_with("servo")


def test_answers_of_urbiscript_are_those_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = {}
    for number, page in enumerate(pages_with("")):
        folder = tmp_path / str(number)
        folder.mkdir()
        monkeypatch.chdir(folder)  # some pages write files
        if found := Windows().play_twice(page, ""):
            wrong[page.name] = found
    assert wrong == {}


def test_answers_of_the_servo_example_are_those_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs" / "examples")
    wrong = {}
    for page in pages_with("servo"):
        windows = Windows()
        importlib.import_module("servo_demo").register(windows.player.kernel)
        if found := windows.play_twice(page, "servo"):
            wrong[page.name] = found
    assert wrong == {}


def test_a_block_in_an_unknown_world_is_a_mistake(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```urbiscript nowhere\n1;\n```\n")
    with pytest.raises(ValueError, match="no world 'nowhere'"):
        blocks(page)
    page.write_text("```urbiscript\n1;\n")
    with pytest.raises(ValueError, match="not closed"):
        blocks(page)


def test_an_answer_never_given_is_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```urbiscript\n1 + 1;\n[00000000] 3\n```\n")
    assert Windows().play_twice(page, "") == (
        "line 2:\n--- expected\n+++ answered\n@@ -1 +1 @@\n-[00000000] 3\n+[00000000] 2"
    )


def test_a_block_that_differs_the_second_time_has_to_say_why(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    text = "```urbiscript{}\nvar Global.once = 1;\n[00000000] 1\n```\n"
    page.write_text(text.format(""))
    assert Windows().play_twice(page, "").startswith("again, line 2:")
    page.write_text(text.format(" differs: it is there by then"))
    assert Windows().play_twice(page, "") == ""
    page.write_text("```urbiscript differs: nobody knows\n1;\n[00000000] 1\n```\n")
    assert Windows().play_twice(page, "") == "line 2: it no longer differs: nobody knows"
