"""Pauses that double."""

from __future__ import annotations

from urbihw.backoff import BackOff


def test_pauses_double_up_to_the_longest_and_begin_again_after_a_success() -> None:
    back_off = BackOff(0.2, 1.0)
    assert [back_off.next_pause() for _ in range(5)] == [0.2, 0.4, 0.8, 1.0, 1.0]
    back_off.reset()
    assert back_off.next_pause() == 0.2


def test_the_first_try_may_be_at_once() -> None:
    back_off = BackOff(1.0, 2.0, at_once=True)
    assert [back_off.next_pause() for _ in range(4)] == [0.0, 1.0, 2.0, 2.0]


def test_no_pause_is_longer_than_the_longest() -> None:
    back_off = BackOff(5.0, 2.0)
    assert [back_off.next_pause() for _ in range(2)] == [2.0, 2.0]
