"""Rows that are written over each other."""

from __future__ import annotations

import io
import os

import pytest

from urbihw.buses.servos.hand_calibration import CalibratedJoint
from urbihw.cli.bars import bars
from urbihw.cli.rows import RowsInPlace


def test_rows_fit_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.get_terminal_size", lambda *_: os.terminal_size((20, 5)))
    rows, screen = RowsInPlace(), io.StringIO()
    rows.show(screen, ["x" * 72, "short"])
    assert screen.getvalue() == f"\r\x1b[K{'x' * 19}\n\r\x1b[Kshort\n\x1b[J"
    rows.show(screen, [str(number) for number in range(9)])
    assert screen.getvalue().partition("short\n\x1b[J")[2] == (
        "\x1b[2A\r\x1b[K0\n\r\x1b[K1\n\r\x1b[K2\n\r\x1b[K... and 6 more; the\n\x1b[J"
    )
    rows.leave()
    screen.truncate(0)
    rows.show(screen, ["below"])
    assert "A" not in screen.getvalue()


def test_rows_stay_where_they_are_when_enter_was_pressed_below_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.get_terminal_size", lambda *_: os.terminal_size((20, 9)))
    rows, screen = RowsInPlace(), io.StringIO()
    rows.skip_line()
    rows.show(screen, ["a", "b"])
    rows.skip_line()
    screen.truncate(0)
    rows.show(screen, ["a", "b"])
    assert "\x1b[3A\r\x1b[Ka\n" in screen.getvalue()


def test_bars_shrink_before_a_number_is_cut() -> None:
    joints = [
        CalibratedJoint("shoulder_pan", None, present=-2047, low=-2048, high=30000),  # type: ignore[arg-type]
        CalibratedJoint("gripper", None, present=7, low=7, high=7),  # type: ignore[arg-type]
    ]
    narrow, wide = bars(joints, 60), bars(joints, 200)
    assert max(map(len, narrow)) < 60
    assert narrow[0].split()[-2:] == ["at", "-2047"]
    assert narrow[1].endswith("not moved yet")
    assert [line.count("=") for line in wide] == [39, 39]
