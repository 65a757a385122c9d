"""Curves of a recording in the terminal."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import pytest
from recording_lab import write

from urbihw.cli.main import main
from urbihw.cli.plot import column_of
from urbihw.recording.drawing import GUTTER, draw

BLANK = chr(0x2800)


def rows(curve: list[tuple[float, float]]) -> list[str]:
    """The drawing of a curve over a second, in five lines of 20 characters."""
    return list(draw("6.position", curve, 0.0, 1.0, GUTTER + 20, 5))


def test_a_curve_goes_from_its_lowest_value_to_its_highest() -> None:
    title, top, *_, bottom = drawn = rows([(step / 100, step / 100) for step in range(101)])
    assert len(drawn) == 5 and max(map(len, drawn)) == GUTTER + 20
    assert title.strip() == "6.position"
    assert top[:GUTTER].strip() == "1" and bottom[:GUTTER].strip() == "0"
    assert top[GUTTER] == BLANK and top[-1] != BLANK
    assert bottom[GUTTER] != BLANK and bottom[-1] == BLANK
    lit = [column for line in drawn[1:] for column, sign in enumerate(line[GUTTER:]) if sign != BLANK]
    assert {*lit} == {*range(20)}, "no hole in it"


def test_a_gap_is_left_where_nothing_was_measured_and_one_value_stays_a_dot() -> None:
    drawn = rows([*((step / 100, 1.0) for step in range(30)), *((step / 100, 1.0) for step in range(70, 101))])
    lit = {column for line in drawn[1:] for column, sign in enumerate(line[GUTTER:]) if sign != BLANK}
    assert not lit & {*range(7, 13)} and {0, 5, 14, 19} <= lit
    assert sum(sign != BLANK for line in rows([(0.5, 3.0)])[1:] for sign in line[GUTTER:]) == 1


def test_values_that_are_no_numbers_and_times_outside_are_left_out() -> None:
    assert rows([(0.5, math.nan), (7.0, 1.0)])[1].strip() == "no values between 0 and 1 s"
    assert rows([(0.2, 1.0), (0.5, math.inf), (0.8, 2.0), (1.2, 99.0)])[1][:GUTTER].strip() == "2"


@pytest.mark.parametrize("top", [1e308, 5e-324])
def test_values_whose_distance_is_no_usual_number_are_drawn(top: float) -> None:
    low = -top if top > 1 else 0.0
    drawn = rows([(0.0, low), (1.0, top)])
    assert drawn[1][-1] != BLANK and drawn[-1][GUTTER] != BLANK


def test_a_whole_number_beyond_all_floats_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "arm.mcap"
    lines = [{"event": "Values", "time": 1.0 + n, "values": {"6": {"position": value}}, "at": 1.0 + n}
             for n, value in enumerate((1, 10**400, 3))]
    write(path, [json.dumps(line).encode() for line in lines], "so101")
    assert main(["plot", str(path), "6"]) == 0
    drawn = capsys.readouterr().out.splitlines()
    assert drawn[1].split()[0] == "3" and drawn[-2].split()[0] == "1"


def test_names_of_joints_and_motors_are_those_of_the_wire() -> None:
    ids = {"gripper": "6"}
    assert [column_of(name, ids) for name in ("gripper.position", "motor7.load", "8", "A.speed", "sensor100")] == [
        "6.position", "7.load", "8", "A.speed", "100",
    ]  # fmt: skip


def test_a_recording_is_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shutil.get_terminal_size", lambda *_: os.terminal_size((60, 20)))
    path = tmp_path / "arm.mcap"
    lines = [
        {"event": "Values", "time": time / 10, "values": {"6": {"position": time / 10, "load": 0.5}}, "at": time / 10}
        for time in range(20)
    ]
    write(path, [json.dumps(line).encode() for line in lines], "so101")
    assert main(["plot", str(path), "gripper.position", "--from", "0.5"]) == 0
    drawn = capsys.readouterr().out.splitlines()
    assert drawn[0].strip() == "6.position" and drawn[1].split()[0] == "1.9" and drawn[-2].split()[0] == "0.5"
    assert drawn[-1].split() == ["0.500", "s", "to", "1.900", "s"]
    assert max(map(len, drawn)) < 60
    assert main(["plot", str(path), "6"]) == 0
    assert [line.strip() for line in capsys.readouterr().out.splitlines() if "6." in line] == ["6.position", "6.load"]
    assert main(["plot", str(path), "nose"]) == 66
    assert "has no values of nose; it has: 6.position, 6.load" in capsys.readouterr().err
