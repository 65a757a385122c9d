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
from urbihw.robot import ROBOT_LIBRARY
from urbihw.ros.script import ROS_LIBRARY


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    """The pages as they would be written now."""
    return Pages().all()


def test_there_is_a_page_for_every_class(pages: dict[str, str]) -> None:
    assert set(SLOTS) <= set(CLASSES) <= set(SAMPLES)
    assert {page.name for page in FOLDER.iterdir()} == set(pages)


def test_the_pages_say_what_the_library_says(pages: dict[str, str]) -> None:
    whole = {page.name: page.read_text().removesuffix(examples(page)) for page in FOLDER.iterdir()}
    old = [name for name, text in pages.items() if whole[name].rstrip("\n") + "\n" != text]
    assert old == [], "run: python -m tests.stdlib.reference_pages"


def test_the_pages_have_examples(pages: dict[str, str]) -> None:
    names = [name for name in pages if name != "README.md"]
    assert [name for name in names if "```urbiscript" not in examples(FOLDER / name).removeprefix(EXAMPLES)] == []


@pytest.fixture(scope="module")
def kernel() -> Kernel:
    return Kernel(fast=True, libraries=(ROBOT_LIBRARY, ROS_LIBRARY))


@pytest.fixture(scope="module")
def docs(kernel: Kernel) -> Docstrings:
    return Docstrings(kernel.world)


def test_every_class_and_slot_is_described(kernel: Kernel, docs: Docstrings) -> None:
    world = kernel.world
    bare = []
    for name in CLASSES:
        holder: Any = world.global_
        for part in name.split("."):
            holder = holder.slots[part]
        bare += [] if docs.about(holder) else [name]
        bare += [f"{name}.{slot}" for slot in world.peek_obj(holder).slots if not docs.of(holder, slot)]
    assert bare == []


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
