"""The tables of docs/from-statement-to-wire.md against the calls that a statement makes on a simulated Bioloid."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any, Final, NamedTuple

import pytest
from bioloid_lab import Lab

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "from-statement-to-wire.md"
OUTSIDE: Final = ("urbihw/kernel/server/", "urbihw/buses/supervisor.py", "urbihw/buses/worker.py")
"""Sockets, and a worker in a process of its own: a lab has neither."""
_CHAPTER = re.compile(r"^## (.+)$", re.M)
_ROW = re.compile(r"^\| `([\w/]+\.py)`: `([\w.]+)` \|", re.M)
MOVE, BACK, STOP = "`motor6.val = 1;`", "The position comes back", "An emergency stop: `bioloid.estop = true;`"


class Step(NamedTuple):
    """A row of a table: a function, and the module in which it is defined."""

    file: str
    name: str


def ways() -> dict[str, list[Step]]:
    """Chapter -> the steps of its tables."""
    _, *pieces = _CHAPTER.split(PAGE.read_text("utf-8"))
    return {
        title: [Step(*row) for row in _ROW.findall(text)] for title, text in zip(pieces[::2], pieces[1::2], strict=True)
    }


def names_of(tree: ast.AST, inside: str = "") -> Iterator[str]:
    """The functions and methods of a module."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef):
            yield from names_of(node, f"{inside}{node.name}.")
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield inside + node.name


def calls(lab: Lab, text: str) -> list[Step]:
    """The functions of urbihw that are called by a statement, and in the two ticks behind it."""
    heard: list[Step] = []

    def hear(frame: FrameType, event: str, _: Any) -> None:
        path = frame.f_code.co_filename
        if event == "call" and path.startswith(f"{ROOT}/urbihw/"):
            heard.append(Step(path[len(str(ROOT)) + 1 :], frame.f_code.co_qualname))

    sys.setprofile(hear)
    try:
        lab.say(text, 0.05)
    finally:
        sys.setprofile(None)
    return heard


def test_every_function_of_the_page_is_there() -> None:
    steps = [step for way in ways().values() for step in way]
    assert len(steps) > 40
    known = {file: {*names_of(ast.parse((ROOT / file).read_text("utf-8")))} for file in {step.file for step in steps}}
    assert [step for step in steps if step.name not in known[step.file]] == []


@pytest.mark.parametrize(
    ("chapter", "text"), [(MOVE, "motor6.val = 1;"), (BACK, "motor6.val = 1;"), (STOP, "bioloid.estop = true;")]
)
def test_the_calls_are_those_of_the_page_and_in_its_order(chapter: str, text: str) -> None:
    heard = iter(calls(Lab.ready(), text))
    steps = [step for step in ways()[chapter] if not step.file.startswith(OUTSIDE)]
    missing = next((step for step in steps if step not in heard), None)
    assert missing is None, f"not called, or earlier than the page says: {missing}"
