"""A key as an emergency stop, without a keyboard: what the kernel would say is handed over."""

from __future__ import annotations

import argparse
import errno
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from urbihw.cli import control, estopkey
from urbihw.cli.main import main

KEY, SPACE, ENTER = 1, 57, 28


def press(code: int, value: int, kind: int = KEY) -> Any:
    return SimpleNamespace(type=kind, code=code, value=value)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Who asked for an emergency stop."""
    found: list[str] = []

    def run(verb: str, options: argparse.Namespace) -> int:
        assert verb == "estop"
        found.append(options.who)
        return 0

    monkeypatch.setattr(control, "run", run)
    return found


def test_each_press_of_the_key_stops_and_nothing_else_does(asked: list[str]) -> None:
    others = [press(SPACE, 2), press(SPACE, 0), press(ENTER, 1), press(SPACE, 1, kind=2)]
    events = [press(SPACE, 1), *others, press(SPACE, 1)]
    assert estopkey.listen(events, (KEY, SPACE), argparse.Namespace(who="the button")) == 0
    assert asked == ["the button", "the button"]


def test_a_button_that_is_pulled_out_is_a_press(asked: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    def events() -> Iterator[Any]:
        yield press(ENTER, 1)
        raise OSError(errno.ENODEV, "No such device")

    assert estopkey.listen(events(), (KEY, SPACE), argparse.Namespace(who="the button")) == 69
    assert asked == ["the button, which was unplugged"]
    assert "the device of the key is gone: No such device" in capsys.readouterr().err


def test_a_key_without_a_device_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estop", "--key", "KEY_SPACE"]) == 78
    assert "wants a device and a key" in capsys.readouterr().err
