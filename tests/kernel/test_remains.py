"""Large lists that nobody refers to any more are freed in slices."""

from __future__ import annotations

from typing import Any, ClassVar

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.runtime.remains import LARGE, SLICE_SIZE, TIME_SLICE_S
from urbihw.kernel.sched.clock import SimClock


class Member:
    """Counts those that live."""

    alive: ClassVar[int] = 0

    def __init__(self) -> None:
        Member.alive += 1

    def __del__(self) -> None:
        Member.alive -= 1


class SlowClock(SimClock):
    """Each look at it takes half of the time in which members are freed."""

    def now(self) -> float:
        self.idle(super().now() + 0.6 * TIME_SLICE_S)
        return super().now()


@pytest.fixture
def kernel() -> Kernel:
    return Kernel(SlowClock())


def members(number: int) -> list[Any]:
    Member.alive = 0
    return [Member() for _ in range(number)]


def test_the_members_of_a_large_list_are_freed_in_slices(kernel: Kernel) -> None:
    made = kernel.world.new_list(members(LARGE))
    assert Member.alive == LARGE
    del made
    assert Member.alive == LARGE
    left = [LARGE]
    while left[-1]:
        kernel.scheduler.run()
        left.append(Member.alive)
        assert 0 < left[-2] - left[-1] <= 4 * SLICE_SIZE, left


def test_a_list_that_is_still_walked_through_keeps_its_members(kernel: Kernel) -> None:
    made = kernel.world.new_list(members(LARGE))
    values = made.l
    del made
    kernel.scheduler.run()
    assert len(values) == Member.alive == LARGE


def test_a_small_list_is_freed_at_once(kernel: Kernel) -> None:
    made = kernel.world.new_list(members(LARGE - 1))
    del made
    assert Member.alive == 0
