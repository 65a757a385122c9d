"""The arguments of built-ins are checked by the types of the parameters, however many there are."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.runtime.arguments import annotated_type
from urbihw.kernel.runtime.primitive import CheckedPrimitive, Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.clock import SimClock
from urbihw.robot import ROBOT_LIBRARY
from urbihw.ros.script import ROS_LIBRARY

table = Table("Checks")


@table.primitive("total")
def total(world: World, this: Any, first: str, *others: float) -> str:
    """A text, and the sum of the rest."""
    return first + str(sum(others))


def test_each_of_many_arguments_is_checked_and_numbered() -> None:
    kernel = Kernel(SimClock())
    lobby = kernel.open_lobby()
    table.install(kernel.host.world, kernel.host.world.global_)
    many = ", ".join(["1"] * 80)
    assert "a80" in kernel.run_text(lobby, f'total("a", {many});')
    assert "argument 82" in kernel.run_text(lobby, f'total("a", {many}, "b");')


def test_the_content_of_a_binary_is_no_part_of_an_error() -> None:
    kernel = Kernel(SimClock())
    said = kernel.run_text(kernel.open_lobby(), 'var b = BIN 10 jpeg 3 4;0123456789; "a".split(b); sleep(b);')
    assert "unexpected BIN 10 jpeg 3 4 for argument 1, expected a String" in said
    assert "unexpected BIN 10 jpeg 3 4 for argument 1, expected a Float" in said
    assert said.count("0123456789") == 1  # the value itself


def test_a_class_that_the_module_does_not_have_is_named_when_the_built_in_is_made() -> None:
    def lost(world: World, this: Any, thing: Nowhere) -> None:  # type: ignore[name-defined]  # noqa: F821
        """Takes an argument of an unknown type."""

    with pytest.raises(NameError, match="no class Nowhere for thing"):
        annotated_type(lost, "thing")


def test_each_built_in_of_the_library_finds_the_classes_of_its_arguments() -> None:
    """Their checks are made at the first call, so that a start does without them."""
    world = Kernel(SimClock(), libraries=(ROBOT_LIBRARY, ROS_LIBRARY)).world
    made = [value for proto in world.classes.values() for value in proto.slots.values()]
    checked = [value for value in made if isinstance(value, CheckedPrimitive)]
    assert len(checked) > 500
    assert all(primitive.fn for primitive in checked)


@pytest.fixture(scope="module")
def last_world(few_objects: None) -> weakref.ref[World]:
    """The world of a kernel that is closed; kernels of other fixtures are kept until the end of their test."""
    kernel = Kernel(SimClock())
    kernel.run_text(kernel.open_lobby(), "[1, 2].size;")
    kernel.close()
    return weakref.ref(kernel.world)


def test_a_built_in_that_was_called_keeps_no_kernel_alive(last_world: weakref.ref[World]) -> None:
    for _ in range(3):
        gc.collect()
    assert last_world() is None
