"""A way as the wheels tell it, added to a pose."""

from __future__ import annotations

import math

import pytest

from urbihw.navigation.frames import ORIGIN, moved


def test_straight_on() -> None:
    assert moved((1.0, 2.0, math.pi / 2), 0.5, 0.0) == pytest.approx((1.0, 2.5, math.pi / 2))


def test_on_the_spot() -> None:
    assert moved((1.0, 2.0, 0.0), 0.0, -1.0) == pytest.approx((1.0, 2.0, -1.0))


@pytest.mark.parametrize("steps", [1, 3, 100])
def test_an_arc_ends_where_it_ends_in_however_many_steps_it_was_read(steps: int) -> None:
    pose = ORIGIN
    for _ in range(steps):
        # A quarter of a circle of 1 m radius.
        pose = moved(pose, math.pi / 2 / steps, math.pi / 2 / steps)
    assert pose == pytest.approx((1.0, 1.0, math.pi / 2))


def test_a_heading_stays_within_half_a_turn() -> None:
    assert moved((0.0, 0.0, 3.0), 0.0, 1.0)[2] == pytest.approx(4.0 - 2 * math.pi)
