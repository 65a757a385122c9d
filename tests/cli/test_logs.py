"""The log lines of all programs: what a device says can neither forge a line nor command a terminal."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable
from typing import Any

import pytest

from urbihw.cli import serve
from urbihw.cli.logs import make_handler

Capture = pytest.CaptureFixture[str]

HOSTILE = "\x1b[2J\x1bcPWN\r\nurbihw: forged\x00\x9b31m\u202e\udc80\t."
SHOWN = r"\x1b[2J\x1bcPWN\r\nurbihw: forged\x00\x9b31m\u202e\udc80\t."


log = logging.getLogger("urbihw.test")


@pytest.fixture
def no_log(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Makes this a process without a log so far; to be called in the test, where pytest has added its own."""
    monkeypatch.setattr(logging.root, "level", logging.WARNING)
    return lambda: monkeypatch.setattr(logging.root, "handlers", [])


def test_a_record_is_one_line_without_control_characters(no_log: Callable[[], None], capsys: Capture) -> None:
    no_log()
    logging.basicConfig(handlers=[make_handler("urbihw")])
    log.warning("the brick %s, %s", HOSTILE, "Größe 5 °C")
    log.warning(HOSTILE)
    assert capsys.readouterr().err == f"urbihw: the brick {SHOWN}, Größe 5 °C\nurbihw: {SHOWN}\n"


def test_a_traceback_keeps_its_lines(no_log: Callable[[], None], capsys: Capture) -> None:
    no_log()
    logging.basicConfig(handlers=[make_handler("urbihw")])
    try:
        raise ValueError("a\x1bc\nb")
    except ValueError:
        log.exception("it failed")
    lines = capsys.readouterr().err.splitlines()
    assert lines[:2] == ["urbihw: it failed", "Traceback (most recent call last):"]
    assert lines[-2:] == [r"ValueError: a\x1bc", "b"]


def test_the_daemon_logs_so(no_log: Callable[[], None], capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    async def start(service: Any) -> int:
        log.warning("port 1 of here: nxt: %s", HOSTILE)
        return 0

    no_log()
    monkeypatch.setattr(serve, "_serve", start)
    parser = argparse.ArgumentParser()
    serve.options(parser)
    assert serve.run(parser.parse_args(["--platform", "nxt", "--fake"])) == 0
    assert capsys.readouterr().err == f"urbihw: port 1 of here: nxt: {SHOWN}\n"
