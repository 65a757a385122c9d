"""What keys and sticks ask of ``urbihw drive``."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from urbihw.cli.drivekeys import (
    FIRST_HOLD_S,
    LEAST_FULL,
    MOST_FULL,
    REPEAT_HOLD_S,
    STAND,
    KeyOrder,
    Keys,
    Wish,
    change_full,
)
from urbihw.cli.drivepad import Pad

CODES = {"EV_KEY": 1, "EV_ABS": 3, "BTN_TL": 310, "BTN_TR": 311, "ABS_X": 0, "ABS_Y": 1}


def test_a_pressed_key_counts_as_held_until_it_should_repeat() -> None:
    keys = Keys()
    assert keys.feed("w", 10.0) == []
    assert keys.wish(10.0 + FIRST_HOLD_S - 0.01) == Wish(1, 0)
    assert keys.wish(10.0 + FIRST_HOLD_S + 0.01) == STAND


def test_a_repeating_key_counts_as_held_until_the_next_repetition_is_missing() -> None:
    keys = Keys()
    for now in (10.0, 10.5, 10.6):
        keys.feed("w", now)
    assert keys.wish(10.6 + REPEAT_HOLD_S - 0.01) == Wish(1, 0)
    assert keys.wish(10.6 + REPEAT_HOLD_S + 0.01) == STAND


@pytest.mark.parametrize(
    ("text", "wish"),
    [
        ("\x1b[A", Wish(1, 0)),
        ("\x1bOB", Wish(-1, 0)),
        ("\x1b[D", Wish(0, 1)),
        ("\x1b[1;5C", Wish(0, -1)),
        ("W", Wish(1, 0)),
        ("u", Wish(1, 1)),
        ("w ", STAND),
        ("wx", STAND),
        ("w\x1b", STAND),
        ("w\x1b[5~", STAND),
        ("\x1b[A\x1b[A\x1b[D", Wish(0, 1)),
    ],
)
def test_keys_and_what_they_ask_for(text: str, wish: Wish) -> None:
    keys = Keys()
    keys.feed(text, 1.0)
    assert keys.wish(1.1) == wish


def test_keys_that_are_no_movement_do_not_end_one() -> None:
    keys = Keys()
    orders = [KeyOrder.FASTER, KeyOrder.SLOWER, KeyOrder.SUSPEND, KeyOrder.LEAVE, KeyOrder.LEAVE]
    assert keys.feed("w+-\x1aq\x03", 1.0) == orders
    assert keys.wish(1.1) == Wish(1, 0)
    keys.release()
    assert keys.wish(1.1) == STAND


def test_held_keys_of_the_speed_stay_within_bounds_and_come_back() -> None:
    full = 0.2
    for _ in range(3000):
        full = change_full(full, KeyOrder.FASTER)
    assert full == MOST_FULL
    for _ in range(3000):
        full = change_full(full, KeyOrder.SLOWER)
    assert full == LEAST_FULL
    assert f"{full:.2f}" != "0.00"
    for _ in range(10):
        full = change_full(full, KeyOrder.FASTER)
    assert full > 2 * LEAST_FULL


def _pad() -> Pad:
    device: Any = SimpleNamespace(absinfo=lambda axis: SimpleNamespace(min=-128, max=127), fileno=lambda: 3)
    return Pad(device, CODES)


def _event(kind: str, code: str, value: int) -> Any:
    return SimpleNamespace(type=CODES[kind], code=CODES[code], value=value)


def test_the_stick_drives_while_the_dead_man_is_held() -> None:
    pad = _pad()
    pad.feed([_event("EV_ABS", "ABS_Y", -128), _event("EV_ABS", "ABS_X", 127)])
    assert pad.wish() == STAND
    pad.feed([_event("EV_KEY", "BTN_TL", 1)])
    assert pad.wish() == Wish(1.0, -1.0)
    pad.feed([_event("EV_KEY", "BTN_TL", 0)])
    assert pad.wish() == STAND


def test_either_shoulder_button_is_the_dead_man_and_a_trembling_stick_stands() -> None:
    pad = _pad()
    pad.feed([_event("EV_KEY", "BTN_TR", 1), _event("EV_ABS", "ABS_Y", 10), _event("EV_ABS", "ABS_X", -12)])
    assert pad.wish() == Wish(0.0, 0.0)
    pad.feed([_event("EV_ABS", "ABS_Y", -64)])
    assert 0.3 < pad.wish().forward < 0.5
    pad.release()
    assert pad.wish() == STAND
