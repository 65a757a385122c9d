"""Rows that are written over each other."""

from __future__ import annotations

import io
import os

import pytest

from urbihw.cli.rows import RowsInPlace


def test_rows_fit_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.get_terminal_size", lambda *_: os.terminal_size((20, 5)))
    rows, screen = RowsInPlace(), io.StringIO()
    rows.show(screen, ["x" * 72, "short"])
    assert screen.getvalue() == f"\r\x1b[K{'x' * 19}\n\r\x1b[Kshort\n"
    rows.show(screen, [str(number) for number in range(9)])
    assert screen.getvalue().partition("short\n")[2] == (
        "\x1b[2A\r\x1b[K0\n\r\x1b[K1\n\r\x1b[K2\n\r\x1b[K... and 6 more; the\n"
    )
    rows.leave()
    screen.truncate(0)
    rows.show(screen, ["below"])
    assert "A" not in screen.getvalue()
