"""The documents against what they speak of: dependencies, adapters, links, paths."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "urbihw").rglob("*.md")])

_NAME = re.compile(r"[A-Za-z0-9-]+")
_LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
_PATH = re.compile(r"`((?:urbihw|fakes|tests|docs|bench|share)/[\w./-]+)`")


def requirements() -> dict[str, str]:
    """Every package that pyproject.toml names, with its range."""
    whole = tomllib.loads((ROOT / "pyproject.toml").read_text())
    project = whole["project"]
    extras = [row for extra in project["optional-dependencies"].values() for row in extra]
    named = [*whole["build-system"]["requires"], *project["dependencies"], *extras]
    found = {}
    for row in named:
        name = _NAME.match(row)
        assert name is not None, row
        found[name[0]] = row[name.end() :]
    return found


def test_every_dependency_has_its_row_with_range_and_reason() -> None:
    page = (ROOT / "docs" / "dependencies.md").read_text()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in page.splitlines() if line.startswith("|")]
    documented = {row[0]: row[1] for row in rows if row[0] != "package" and row[2] and not row[0].startswith("-")}
    assert documented == requirements()


def test_every_dependency_is_bounded_above_but_those_of_the_build() -> None:
    assert [name for name, bounds in requirements().items() if "<" not in bounds] == ["setuptools"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_paths_lead_somewhere(page: Path) -> None:
    text = page.read_text()
    links = [link for link in _LINK.findall(text) if "://" not in link]
    gone = [link for link in links if not (page.parent / link).exists()]
    gone += [path for path in _PATH.findall(text) if not (ROOT / path).exists()]
    assert gone == []


def test_the_udev_rules_name_the_adapters_of_the_manifests() -> None:
    wanted = set()
    for manifest in (ROOT / "urbihw" / "platforms").glob("*/platform.toml"):
        for usb in tomllib.loads(manifest.read_text()).get("usb", []):
            wanted.add((f"{usb['vendor']:04x}", f"{usb['product']:04x}", f"urbihw-{manifest.parent.name}"))
    rules = (ROOT / "share" / "99-urbihw.rules").read_text()
    row = re.compile(r'^ATTRS\{idVendor\}=="(\w+)", ATTRS\{idProduct\}=="(\w+)", SYMLINK\+="([\w-]+)"', re.MULTILINE)
    assert wanted
    assert set(row.findall(rules)) == wanted
