"""The classes and slots that the manual documents are there: ``slots.txt`` is the manual's list, by hand."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from library_samples import SAMPLES

from urbihw.kernel import Kernel
from urbihw.robot import ROBOT_LIBRARY
from urbihw.ros.script import ROS_LIBRARY

UNSET = {("Event", "onSubscribe")}
"""Slots that are not there until somebody makes them, says the manual itself."""


def documented() -> dict[str, list[str]]:
    """Class -> slots; a line that begins with a space goes on."""
    found: dict[str, list[str]] = {}
    name = ""
    for line in Path(__file__).with_name("slots.txt").read_text().splitlines():
        if line.startswith("#"):
            continue
        if not line.startswith(" "):
            name, _, line = line.partition(":")
            found[name] = []
        found[name] += line.split()
    return found


SLOTS = documented()


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Kernel]:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("slots"))
        yield Kernel(fast=True, libraries=(ROBOT_LIBRARY, ROS_LIBRARY))


def sample(kernel: Kernel, name: str) -> Any:
    """An object of a class: some slots are there in objects only, and not in the class."""
    lobby = kernel.open_lobby("127.0.0.1")
    text = "lobby" if name == "Lobby" else SAMPLES[name]  # one of a connection has more slots than one without
    assert kernel.run_text(lobby, f"var found = closure () {{ {text} }}|;") == ""
    values: list[Any] = []

    def run() -> None:
        values.append(kernel.world.invoke(lobby.slots["found"], lobby))

    kernel.scheduler.spawn(run, "sample", context=lobby)
    kernel.scheduler.run_simulated(kernel.clock.now() + 1)
    return values[0]


def test_the_table_is_whole() -> None:
    assert set(SLOTS) <= set(SAMPLES)
    assert len(SLOTS) == 70
    assert sum(map(len, SLOTS.values())) == 702


@pytest.mark.parametrize("name", SLOTS)
def test_every_slot_of_the_manual_is_there(kernel: Kernel, name: str) -> None:
    world = kernel.world
    holder: Any = world.global_
    for part in name.split("."):
        assert part in holder.slots
        holder = holder.slots[part]
    of_class, of_object = world.peek_obj(holder), world.peek_obj(sample(kernel, name))
    missing = [
        slot for slot in SLOTS[name]
        if (name, slot) not in UNSET and of_class.find(slot) is None and of_object.find(slot) is None
    ]
    assert missing == []


def test_a_slot_that_is_not_set_can_be(kernel: Kernel) -> None:
    lobby = kernel.open_lobby("127.0.0.1")
    typed = "var e = Event.new|; var e.onSubscribe = Event.new|; at (e.onSubscribe?) echo(1); at (e?) echo(2);"
    assert kernel.run_text(lobby, typed).endswith("*** 1\n")
