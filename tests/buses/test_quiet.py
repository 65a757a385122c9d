"""A line on which somebody talks unasked: one line of text in less than a second, not an endless search."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from urbihw.buses.errors import Unavailable
from urbihw.buses.servos.line import ServoLine
from urbihw.buses.servos.quiet import check_quiet
from urbihw.buses.servos.survey import survey
from urbihw.cli.main import main

from .line_rig import LineRig, ax

SEED = 20


def talk(rig: LineRig, size: int, period: float, seconds: float) -> None:
    """Let somebody send random bytes, a burst each period."""
    source = random.Random(SEED)
    start = rig.clock.now()
    for number in range(int(seconds / period)):
        rig.end.send(source.randbytes(size), start + number * period)


@pytest.mark.parametrize(("size", "period"), [(2048, 0.02), (1, 0.05), (20_000, 0.001)])
def test_garbage_on_a_line_is_told_at_once(size: int, period: float) -> None:
    rig = LineRig([ax(1)])
    talk(rig, size, period, 5.0)
    with pytest.raises(Unavailable, match=r"garbage on this port at 1000000 bps: \d+ bytes in 0\.\d s without"):
        check_quiet(rig.line)
    assert rig.clock.now() - 100.0 < 0.5
    assert not rig.sent


def test_a_quiet_line_and_the_end_of_an_answer_pass() -> None:
    rig = LineRig([ax(1)])
    check_quiet(rig.line)
    assert rig.clock.now() - 100.0 < 0.1
    talk(rig, 6, 0.01, 0.05)
    check_quiet(rig.line)
    assert [servo.device.id for servo in survey(rig.line, [1_000_000]).servos] == [1]


def test_a_search_ends_when_the_garbage_begins_later() -> None:
    rig = LineRig([])
    talk(rig, 64, 0.02, 120.0)
    survey(rig.line, [57_600])
    assert rig.clock.now() - 100.0 < 60.0


@pytest.mark.parametrize(
    "words", [["scan", "URL"], ["servo", "backup", "URL", "FILE"], ["servo", "read", "URL", "all"]], ids=" ".join
)
def test_each_tool_says_it_in_one_line(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = LineRig([ax(1)])
    talk(rig, 2048, 0.02, 5.0)
    monkeypatch.setattr(ServoLine, "open", lambda url, baud=None: rig.line)
    names = {"URL": "pipe://robot?baud=1000000", "FILE": f"{tmp_path}/robot.toml"}
    assert main([names.get(word, word) for word in words]) == 78
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("urbihw: pipe://robot: garbage on this port at 1000000 bps: ")
