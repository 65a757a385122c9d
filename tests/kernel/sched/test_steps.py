"""Work done in steps on a stack of its own."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pytest

from urbihw.kernel.sched.coro import Steps


def test_each_pause_is_a_step_and_the_result_comes_at_the_end() -> None:
    seen: list[int] = []

    def work(pause: Callable[[], None]) -> str:
        for step in range(3):
            seen.append(step)
            pause()
        return "done"

    steps = Steps(work)
    assert [steps.step() for _ in range(4)] == [True, True, True, False]
    assert seen == [0, 1, 2]
    assert steps.result == "done"


def test_an_error_of_the_work_is_raised_by_its_step() -> None:
    def work(pause: Callable[[], None]) -> None:
        pause()
        raise ValueError("no")

    steps = Steps(work)
    assert steps.step()
    with pytest.raises(ValueError, match="no"):
        steps.step()


def test_work_that_is_given_up_leaves_by_its_finally_clauses() -> None:
    left: list[str] = []

    def work(pause: Callable[[], None]) -> None:
        try:
            pause()
        finally:
            left.append("left")

    begun, unbegun = Steps(work), Steps(work)
    begun.step()
    begun.end()
    unbegun.end()
    assert left == ["left"]


def deep(levels: int, inside: Callable[[], None]) -> None:
    if levels:
        deep(levels - 1, inside)
    else:
        inside()


def test_the_limit_of_recursion_is_the_work_s_own() -> None:
    usual = sys.getrecursionlimit()

    def work(pause: Callable[[], None]) -> None:
        sys.setrecursionlimit(usual + 3000)
        try:
            deep(usual + 1000, pause)
        finally:
            sys.setrecursionlimit(usual)

    for give_up in (False, True):
        steps = Steps(work)
        assert steps.step()
        assert sys.getrecursionlimit() == usual
        with pytest.raises(RecursionError):
            deep(usual, lambda: None)
        if give_up:
            steps.end()
        else:
            assert not steps.step()
        assert sys.getrecursionlimit() == usual
