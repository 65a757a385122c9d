"""The arguments of built-ins are checked by the types of the parameters, however many there are."""

from __future__ import annotations

from typing import Any

from urbihw.kernel import Kernel
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.clock import SimClock

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
