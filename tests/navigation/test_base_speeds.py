"""The speeds that a base gets: never beyond its own, slower before an obstacle, none with blocked wheels."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from urbihw.navigation.drive import STALL_TIMEOUT_S, Drive, Safety, State

FREE = State(time=0.0, v=0.0, w=0.0)


def drive() -> Drive:
    made = Drive(lambda motion, how: None)
    made.safety = Safety(0.2, 1.2)
    return made


@pytest.mark.parametrize("sign", (1.0, -1.0))
def test_a_base_slows_down_before_an_obstacle_and_never_backs_away_from_it(sign: float) -> None:
    base = drive()
    base.set(v=0.5 * sign)

    def with_room(ahead: float, behind: float = math.inf) -> float:
        front, rear = (ahead, behind) if sign > 0 else (behind, ahead)
        return base.step(replace(FREE, front=front, rear=rear))[0]

    speeds = [with_room(room) for room in (2.0, 1.2, 0.7, 0.2, 0.1)]
    assert speeds == pytest.approx([0.5 * sign, 0.5 * sign, 0.25 * sign, 0.0, 0.0])
    # What is behind it does not matter.
    assert with_room(math.inf, 0.1) == pytest.approx(0.5 * sign)


def test_a_speed_is_never_beyond_that_of_the_base() -> None:
    base = drive()
    for sign in (1.0, -1.0):
        base.set(v=99.0 * sign, w=99.0 * sign)
        assert base.step(FREE) == (base.limits.fastest * sign, base.limits.fastest_turn * sign)


def test_wheels_that_are_blocked_for_a_while_get_no_speed() -> None:
    base = drive()
    base.set(v=0.3)
    stalled = replace(FREE, stalled=True)
    assert base.step(stalled)[0] == 0.3
    assert base.step(replace(stalled, time=STALL_TIMEOUT_S - 0.1))[0] == 0.3
    assert base.step(replace(stalled, time=STALL_TIMEOUT_S))[0] == 0.0
    assert base.step(replace(FREE, time=STALL_TIMEOUT_S + 1))[0] == 0.0
