"""The reference pages are what the library says of itself, whole; each shows an example, played by test_docs.py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from library_samples import SAMPLES
from reference_pages import CLASSES, EXAMPLES, FOLDER, Pages, examples
from test_slots import SLOTS

from urbihw.kernel import Kernel
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.stdlib.documentation import Docstrings

PAGES = Pages().all()


def test_there_is_a_page_for_every_class() -> None:
    assert set(SLOTS) <= set(CLASSES) <= set(SAMPLES)
    assert {page.name for page in FOLDER.iterdir()} == set(PAGES)


@pytest.mark.parametrize("name", PAGES)
def test_the_page_says_what_the_library_says(name: str) -> None:
    page = FOLDER / name
    written = page.read_text().removesuffix(examples(page)).rstrip("\n") + "\n"
    assert written == PAGES[name], "run: python -m tests.stdlib.reference_pages"


@pytest.mark.parametrize("name", [name for name in PAGES if name != "README.md"])
def test_the_page_has_an_example(name: str) -> None:
    assert "```urbiscript\n" in examples(FOLDER / name).removeprefix(EXAMPLES)


@pytest.fixture(scope="module")
def kernel() -> Kernel:
    return Kernel(fast=True)


@pytest.fixture(scope="module")
def docs(kernel: Kernel) -> Docstrings:
    return Docstrings(kernel.world)


@pytest.mark.parametrize("name", CLASSES)
def test_every_slot_is_described(kernel: Kernel, docs: Docstrings, name: str) -> None:
    world = kernel.world
    holder: Any = world.global_
    for part in name.split("."):
        holder = holder.slots[part]
    assert docs.about(holder)
    assert [slot for slot in world.peek_obj(holder).slots if not docs.of(holder, slot)] == []


def test_what_is_said_of_a_function_is_not_said_of_another_of_that_name(kernel: Kernel) -> None:
    lobby = kernel.open_lobby()
    typed = 'function eval () { 1 }|; System.documentation(this, "eval"); System.documentation(System, "eval").empty;'
    assert kernel.run_text(lobby, typed) == '[00000000] ""\n[00000000] false\n'


def test_a_copied_function_is_described_as_the_original_is(kernel: Kernel, docs: Docstrings) -> None:
    control = kernel.world.global_.slots["Control"]
    assert isinstance(control, Obj)
    assert docs.of(kernel.world.global_, "persist") == docs.of(control, "persist") != ""


def test_slots_of_objects_only_are_described_too(kernel: Kernel) -> None:
    lobby = kernel.open_lobby("127.0.0.1")
    typed = 'System.documentation(Socket.new, "received"); System.documentation(lobby, "remoteIP");'
    assert kernel.run_text(lobby, typed).count("[00000000] \"The ") == 2
    assert Path(FOLDER, "socket.md").read_text().count("- `received`: The ") == 1
